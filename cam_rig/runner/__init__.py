"""Processes of the node graph: start, monitoring, end."""
