"""Writing a bag: every message of a run, whatever happens to the nodes."""
