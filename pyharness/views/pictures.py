"""Saving a picture: the same bytes in every run, and its numbers beside it."""

import io
import textwrap
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError
from pyharness.model.report import Picture
from pyharness.views.csv import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
# Without a salt of its own and with a date, a file would have other bytes in every run.
_REPRODUCIBLE: dict[Any, str] = {"svg.hashsalt": "pyharness", "svg.fonttype": "path"}
_DATES: dict[str, dict[Any, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
# Of a title in letters of size 10.
_LETTERS_PER_INCH = 12.5
_MOST_LINES = 4


def check_picture(path: str) -> None:
    """Refuse a picture that can't be made, before anything is computed for it."""
    if _form(path) not in FORMATS:
        raise InputError(f"--plot '{path}': unknown picture format; allowed: {', '.join(FORMATS)}")
    check_matplotlib("--plot")


def check_matplotlib(what: str) -> None:
    """Refuse to draw where matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise InputError(f"{what} needs matplotlib: {install_command('plots')}") from None


def numbers_beside(path: str) -> str:
    """Return where the numbers of a picture go."""
    return str(Path(path).with_suffix(".csv"))


def saved(picture: Picture, *paths: str) -> dict[str, bytes]:
    """Return content by path: the picture in the format of each suffix, and its numbers as CSV."""
    _set_title(picture)
    content = {path: _image(picture.figure, _form(path)) for path in paths}
    return content | {numbers_beside(paths[0]): csv_text(picture.numbers).encode()}


def _form(path: str) -> str:
    return Path(path).suffix.lstrip(".").lower()


def _set_title(picture: Picture) -> None:
    """Write the title in as many lines as the width takes."""
    if not picture.title:
        return
    room = int(_LETTERS_PER_INCH * picture.figure.get_figwidth())
    lines = [
        line
        for each in picture.title
        for line in textwrap.wrap(
            each, room, max_lines=_MOST_LINES, placeholder=" ...", break_on_hyphens=False
        )
    ]
    picture.figure.suptitle("\n".join(lines), fontsize=10, parse_math=False)


def _image(figure: "Figure", form: str) -> bytes:
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(_REPRODUCIBLE), warnings.catch_warnings():
        # A box stands for a letter that the font lacks, as everywhere.
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        figure.savefig(buffer, format=form, dpi="figure", metadata=_DATES.get(form))
    return buffer.getvalue()
