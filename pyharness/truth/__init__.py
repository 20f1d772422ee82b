"""Reference solutions of scenes in multiple precision, with bounds on their errors."""
