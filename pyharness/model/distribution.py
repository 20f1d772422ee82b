"""The name and version of the distribution; optional packages."""

from typing import TYPE_CHECKING

from pyharness.model.errors import InputError, kind_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The name `pyharness` belongs to another package on PyPI.
DISTRIBUTION = "rigid-body-harness"


def version() -> str:
    from importlib.metadata import version

    return version(DISTRIBUTION)


def install_command(extra: str) -> str:
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def check_package(name: str, what: str, command: str) -> None:
    from importlib import import_module

    try:
        import_module(name)
    except ImportError:
        raise InputError(f"{what} needs {name}: {command}") from None


def checked_axes(ax: object) -> "Axes":
    check_package("matplotlib", "plot", install_command("plots"))
    from matplotlib.axes import Axes

    if ax is None:
        from matplotlib import pyplot

        return pyplot.subplots()[1]
    if not isinstance(ax, Axes):
        raise InputError(f"plot: ax is {kind_of(ax)}; allowed: an Axes of matplotlib, or none")
    return ax
