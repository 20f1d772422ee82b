"""Cards, Python ports (twins) and compiled runs of the three programs in the thesis's appendix."""
