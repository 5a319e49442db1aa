"""Linear systems: exact response to a polynomial forcing, at any time."""
