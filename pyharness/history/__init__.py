"""The study of the thesis: its program listings, figures and claims."""
