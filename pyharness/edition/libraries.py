"""The libraries that write the pages; they are optional and installed on request."""

from importlib import import_module

from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip


def check_libraries() -> None:
    """Raise InputError if one of the libraries is missing."""
    for name in LIBRARIES:
        try:
            import_module(name)
        except ImportError:
            raise InputError(f"edition needs {name}: {install_command('edition')}") from None
