"""The report: every experiment of the paper, redone and taken further, on one page."""
