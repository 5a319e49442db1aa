"""Search for lift-offs and landings of the follower, in plain Python or compiled."""
