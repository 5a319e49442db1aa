"""Fit of gain and cut-off of a rig's sound radiation to measured sound levels."""
