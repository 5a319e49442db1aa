"""Lab sheets: tasks on a rig in a browser, the readings, and their marks."""
