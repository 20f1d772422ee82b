"""Reference solutions of a scene in multiple precision, with bounds of their errors."""
