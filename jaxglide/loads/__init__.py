"""What acts on the body: the air by sweep theory, and its own changing inertia."""
