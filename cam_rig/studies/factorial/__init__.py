"""What the paper leaves open: does continuity lower vibration, or do gentler slopes."""
