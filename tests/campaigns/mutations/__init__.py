"""Single changes to the sources, and the check that catches each: `make mutate`."""
