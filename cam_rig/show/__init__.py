"""Results as table, text, page and figure, in one style."""
