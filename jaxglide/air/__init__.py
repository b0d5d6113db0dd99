"""The air: where it moves and how, its density and viscosity."""
