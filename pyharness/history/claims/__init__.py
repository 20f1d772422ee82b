"""The claims of the thesis and the verdicts on them."""
