"""Reference solutions of scenes in multiple precision, with bounds of their errors."""
