"""The live bench: the node graph, steered from a page."""
