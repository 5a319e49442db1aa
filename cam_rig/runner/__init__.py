"""Processes of the nodes of a run: their start, monitoring and end."""
