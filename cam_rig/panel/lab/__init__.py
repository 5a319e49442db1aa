"""Lab sheets: a student's task on a rig in a browser, the readings, and their marks."""
