"""What writes the pages: libraries that are not there unless they are asked for."""

from importlib import import_module

from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip


def check_libraries() -> None:
    """Refuse to build where one is missing."""
    for name in LIBRARIES:
        try:
            import_module(name)
        except ImportError:
            raise InputError(f"edition needs {name}: {install_command('edition')}") from None
