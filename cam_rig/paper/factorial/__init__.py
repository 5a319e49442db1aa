"""What the paper leaves open: does continuity reduce vibration, or lower acceleration."""
