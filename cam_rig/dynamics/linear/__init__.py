"""Exact response of linear systems to a polynomial forcing, at any time."""
