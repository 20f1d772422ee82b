"""The third-party libraries that write the pages; a user installs these optional packages."""

from pyharness.model.distribution import check_package, install_command

LIBRARIES = (
    "docstring_parser", "jinja2", "latex2mathml", "markdown_it", "markupsafe", "matplotlib",
    "mdit_py_plugins",
)  # fmt: skip


def check_libraries() -> None:
    """Raise InputError if a third-party library that writes the web pages is missing.

    The error message has the command that installs the libraries.
    """
    for name in LIBRARIES:
        check_package(name, "edition", install_command("edition"))
