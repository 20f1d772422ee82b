"""The claims of the thesis, their tests, and the verdicts on them."""
