"""Bags of other programs: readings of quantities from the fields of any topic."""
