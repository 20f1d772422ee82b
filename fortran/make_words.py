"""Write the programs of the appendix in each word, and the choice among them, with fypp."""

from pathlib import Path

import fypp


def texts(choice: str, words: str, *sources: str) -> dict[str, str]:
    """Return the files by name, for words separated by spaces; `choice` is made for all of them."""
    found = {f"{Path(choice).stem}.f90": _expanded(choice, f"WORDS={words.split()}")}
    for word in words.split():
        for source in sources:
            name = f"{Path(source).stem}_{word}.f90"
            found[name] = _expanded(source, f"WORD={word!r}")
    return found


def _expanded(source: str, definition: str) -> str:
    options = fypp.FyppOptions()
    options.defines, options.no_folding = [definition], True
    return str(fypp.Fypp(options).process_text(Path(source).read_text()))
