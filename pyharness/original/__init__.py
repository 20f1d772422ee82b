"""The twins: the three programs of the appendix again, in plain Python."""
