"""The third-party libraries that write the pages; a user installs these optional packages."""

from importlib import import_module

from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip


def check_libraries() -> None:
    """Raise InputError if a third-party library that writes the web pages is missing.

    The error message has the command that installs the libraries.
    """
    for name in LIBRARIES:
        try:
            import_module(name)
        except ImportError:
            raise InputError(f"edition needs {name}: {install_command('edition')}") from None
