"""Checks and generators of documentation, run from the root of the repository.

They are not installed with cam_rig.
"""
