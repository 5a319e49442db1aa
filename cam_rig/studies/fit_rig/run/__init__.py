"""Identification of a follower from the samples of a run."""
