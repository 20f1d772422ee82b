"""The name and version of the distribution, which is not called `pyharness`."""

from pyharness.model.errors import InputError

# On the package index, the name `pyharness` belongs to another package.
DISTRIBUTION = "rigid-body-harness"


def version() -> str:
    """Return the version of the installed distribution."""
    from importlib.metadata import version

    return version(DISTRIBUTION)


def install_command(extra: str) -> str:
    """Return the pip command for a group of optional packages, such as ``plots``."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def check_package(name: str, what: str, command: str) -> None:
    """Raise InputError if a package that `what` needs is not installed."""
    from importlib import import_module

    try:
        import_module(name)
    except ImportError:
        raise InputError(f"{what} needs {name}: {command}") from None
