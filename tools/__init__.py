"""Checks and generators of documentation pictures, run from the project's root.

They are not installed.
"""
