"""The elastic follower in a design: its vibration and force as functions of the unknowns."""
