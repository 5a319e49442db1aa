"""Import of bags of other programs: angle, lift, force and level from any topic."""
