"""Display of results as tables, texts, browser pages and figures, in one style."""
