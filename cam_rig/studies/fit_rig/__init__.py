"""A rig's numbers from what was measured on it."""
