"""The edition as pages: a static site from the project's data and findings."""
