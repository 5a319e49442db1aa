"""Bags of other programs: quantities from the fields of any topic."""
