"""The study of the thesis: its listings, its figures and its claims."""
