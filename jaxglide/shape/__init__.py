"""How a body bends: waves, what drives them, and the kinematics of the backbone."""
