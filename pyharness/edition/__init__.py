"""The edition as a static web site, built from the project's data and findings."""
