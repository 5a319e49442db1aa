"""Live bench: a graph of nodes that is controlled from a web page."""
