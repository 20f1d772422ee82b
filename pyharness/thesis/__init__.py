"""The three programs in the thesis's appendix: cards, Python ports (twins) and compiled runs."""
