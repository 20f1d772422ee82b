"""The claims of the thesis, the tests of these claims, and the verdicts on them."""
