"""The three programs of the thesis's appendix: their cards, Python ports (twins), compiled runs."""
