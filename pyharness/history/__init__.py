"""The study of the thesis: its program listings, its figures (pictures) and its claims."""
