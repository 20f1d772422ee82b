"""The thesis: its listings, its figures, its statements."""
