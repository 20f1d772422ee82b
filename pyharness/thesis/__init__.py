"""The thesis's three programs: cards, Python ports (twins) and compiled runs."""
