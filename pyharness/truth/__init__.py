"""Reference solutions of a scene in multiple-precision arithmetic, with bounds of their errors."""
