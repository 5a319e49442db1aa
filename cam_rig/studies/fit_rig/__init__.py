"""Identification of a rig's parameters from measurements."""
