"""Gain and cut-off of a rig's radiation from measured sound pressure levels."""
