"""Files of a picture: reproducible images, and a CSV of its numbers."""

import io
import textwrap
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyharness.model.distribution import check_package, install_command
from pyharness.model.errors import InputError
from pyharness.model.report import Picture
from pyharness.views.render import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
# Without a fixed salt, or with a date, the bytes would differ in every run.
_REPRODUCIBLE: dict[Any, str] = {"svg.hashsalt": "pyharness", "svg.fonttype": "path"}
_DATES: dict[str, dict[Any, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
# Letters of a title in font size 10.
_LETTERS_PER_INCH = 12.5
_MOST_LINES = 4


def check_picture(path: str) -> None:
    if _form(path) not in FORMATS:
        raise InputError(f"--plot '{path}': unknown picture format; allowed: {', '.join(FORMATS)}")
    check_matplotlib("--plot")


def check_matplotlib(what: str) -> None:
    check_package("matplotlib", what, install_command("plots"))


def numbers_beside(path: str) -> str:
    return str(Path(path).with_suffix(".csv"))


def saved(picture: Picture, *paths: str) -> dict[str, bytes]:
    """Return the contents of files by path: the images, and a CSV file beside the first."""
    _set_title(picture)
    content = {path: _image(picture.figure, _form(path)) for path in paths}
    return content | {numbers_beside(paths[0]): csv_text(picture.numbers).encode()}


def _form(path: str) -> str:
    return Path(path).suffix.lstrip(".").lower()


def _set_title(picture: Picture) -> None:
    if not picture.title:
        return
    room = int(_LETTERS_PER_INCH * picture.figure.get_figwidth())
    wrapper = textwrap.TextWrapper(room, max_lines=_MOST_LINES, placeholder=" ...")
    wrapper.break_on_hyphens = False
    lines = [line for each in picture.title for line in wrapper.wrap(each)]
    picture.figure.suptitle("\n".join(lines), fontsize=10, parse_math=False)


def _image(figure: "Figure", form: str) -> bytes:
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(_REPRODUCIBLE), warnings.catch_warnings():
        # A letter that the font lacks is drawn as a box, without a warning.
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        figure.savefig(buffer, format=form, dpi="figure", metadata=_DATES.get(form))
    return buffer.getvalue()
