"""Reference solutions of a scene in arithmetic of many digits, with bounds of their errors."""
