"""The edition of the thesis and its programs as a static web site, built from data files."""
