"""Identification of a follower from its jump speeds."""
