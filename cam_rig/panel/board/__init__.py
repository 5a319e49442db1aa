"""The drawing board: a law, dragged, and what the follower makes of it."""
