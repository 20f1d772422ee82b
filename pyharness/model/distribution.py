"""Name and version of the installable distribution, which is not called `pyharness`."""

from pyharness.model.errors import InputError

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


def check_package(name: str, what: str, command: str) -> None:
    """Raise InputError if the optional package `name` is not installed.

    The message names `what`, the option or function that needs the package, and `command`, which
    installs the package.
    """
    from importlib import import_module

    try:
        import_module(name)
    except ImportError:
        raise InputError(f"{what} needs {name}: {command}") from None
