"""The rig in a browser: a drawing board for motion laws, a live bench, lab sheets."""
