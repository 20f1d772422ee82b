"""The distribution: its name in a package index, unlike that of the import, and its version."""

# The index has another package by the name of the import.
DISTRIBUTION = "rigid-body-harness"


def version() -> str:
    """Return the version of the installed distribution."""
    from importlib.metadata import version

    return version(DISTRIBUTION)


def install_command(extra: str) -> str:
    """Return the command that installs what an extra needs."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"
