"""Name and version of the installable distribution, which is not called `pyharness`."""

# On the package index, the name `pyharness` belongs to another package.
DISTRIBUTION = "rigid-body-harness"


def version() -> str:
    """Return the version of the installed distribution of this project, as text."""
    from importlib.metadata import version

    return version(DISTRIBUTION)


def install_command(extra: str) -> str:
    """Return the pip command that installs a named group of optional packages.

    `extra` is the name of the group in pyproject.toml, for example ``plots``.
    """
    return f"pip install '{DISTRIBUTION}[{extra}]'"
