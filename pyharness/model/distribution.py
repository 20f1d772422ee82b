"""Name and version of the distribution; its name differs from the name of the import."""

# The package index has another package with the name of our import.
DISTRIBUTION = "rigid-body-harness"


def version() -> str:
    """Return the version of the installed distribution."""
    from importlib.metadata import version

    return version(DISTRIBUTION)


def install_command(extra: str) -> str:
    """Return the pip command that installs the packages of an optional extra."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"
