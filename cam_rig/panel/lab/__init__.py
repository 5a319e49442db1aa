"""Lab sheets: tasks on a rig in a browser, the readings, and the marks of answers."""
