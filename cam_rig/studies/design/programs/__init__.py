"""Convex programs: rows that are affine in the unknowns, solved and bounded."""
