"""The page of one's own scene: its cams, its rig, its speeds."""
