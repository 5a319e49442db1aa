"""Search for lift-offs and landings, in plain Python or compiled."""
