"""A result as table, text, page and figure, in one style; it knows no slice."""
