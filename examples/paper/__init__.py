"""Experiments that only the paper needs, one script each, and the report that shows them."""
