"""Scripts as users write them: they run, and pass `mypy --strict`."""
