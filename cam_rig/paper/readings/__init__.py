"""Table 2 of the paper read in several ways: which rig shows its speeds, and its times."""
