"""Generators of the pictures and pages of the documentation."""
