"""Identification of a rig's follower parameters from measurements."""
