"""What flies: a body along its length, and its division into nodes."""
