"""The optional third-party libraries for writing the pages."""

from pyharness.model.distribution import check_package, install_command

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip


def check_libraries() -> None:
    """Raise InputError, with the command to install them, if a library is missing."""
    for name in LIBRARIES:
        check_package(name, "edition", install_command("edition"))
