"""Samples of a run as columns in files of other programs."""
