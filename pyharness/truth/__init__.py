"""Reference solutions in multiple precision, with bounds on their errors."""
