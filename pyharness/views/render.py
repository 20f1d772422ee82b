"""Choice of the output format of a report.

Each format of the option `--format` has a module of the same name in this package.
"""

from importlib import import_module

from pyharness.model.report import Report


def render(report: Report, form: str) -> str:
    """Return a report, which has the results of a command, as text in the format `form`.

    `form` is ``table`` (plain text), ``csv``, ``markdown``, ``json``, ``junit`` or ``html``.
    """
    text: str = import_module(f"pyharness.views.{form}").write(report)
    return text
