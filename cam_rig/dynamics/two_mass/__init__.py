"""A roller mass and an end mass, joined by the stem (eq. 14-19 of the paper)."""
