"""Cards, Python ports (twins) and compiled runs of the three programs of the appendix."""
