"""The edition as a static web site, built from data files."""
