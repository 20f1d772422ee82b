"""The three programs of the appendix: their cards, Python ports (twins) and compiled runs."""
