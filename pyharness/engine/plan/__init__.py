"""The registry of methods, and the choice of one."""
