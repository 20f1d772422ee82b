"""Single changes to the sources, and which check catches each: run by `make mutate`."""
