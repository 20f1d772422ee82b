"""Bundling of JavaScript (ES) modules into one classic script.

Browsers do not import modules into a page opened from a file. In the script, each module is a
function that returns its exports, and follows the modules that it imports. Only the project's forms
of import and export are supported.
"""

import re
from pathlib import Path

_IMPORT = re.compile(
    r'^import (?:\{(?P<names>[^}]*)\}|\* as (?P<all>\w+)) from "(?P<path>\.\.?/[\w./-]+)";$', re.M
)
_EXPORT = re.compile(r"^export (?=(?:function|const|class) (?P<name>\w+))", re.M)
# An import or export that remains after replacing the supported forms.
_UNKNOWN = re.compile(r"^\s*(?:import|export)\b.*|\bimport\s*[(.]", re.M)
_COMMENT = re.compile(r"^ *//.*\n", re.M)


def bundle(entry: Path) -> str:
    """Return the module in `entry` and all imported modules as one script without global names.

    Raise ValueError for anything unsupported or missing.
    """
    exports: dict[Path, list[str]] = {}
    parts: list[str] = []
    _add(entry.resolve(), (), exports, parts)
    return "\n".join(['"use strict";', "(() => {", *parts, "})();", ""])


def _add(
    path: Path, importing: tuple[Path, ...], exports: dict[Path, list[str]], parts: list[str]
) -> None:
    """Append a module, imported through the chain `importing`, to `parts` after its own imports."""
    text = path.read_text(encoding="utf-8")

    def declare(found: re.Match[str]) -> str:
        needed = (path.parent / found["path"]).resolve()
        if needed in (*importing, path):
            raise _error(path, text, found.start(), f"{needed.name} imports this module too")
        if not needed.is_file():
            raise _error(path, text, found.start(), f"there is no {found['path']}")
        if needed not in exports:
            _add(needed, (*importing, path), exports, parts)
        constants = []
        for each in filter(None, map(str.strip, (found["names"] or "").split(","))):
            name, _, alias = each.partition(" as ")
            if name not in exports[needed]:
                raise _error(path, text, found.start(), f"{needed.name} exports no {name}")
            constants.append(f"{name}: {alias or name}")
        # Keep the number of lines, for error messages.
        lines = "\n" * found[0].count("\n")
        left = found["all"] or f"{{ {', '.join(constants)} }}"
        return f"const {left} = module{list(exports).index(needed)};{lines}"

    names = [found["name"] for found in _EXPORT.finditer(text)]
    body = _EXPORT.sub("", _IMPORT.sub(declare, text))
    unknown = _UNKNOWN.search(body)
    if unknown is not None:
        shown = unknown[0].strip()
        raise _error(path, body, unknown.start(), f"a form that is not known: {shown}")
    parts += [f"// {path.parent.name}/{path.name}", f"const module{len(exports)} = (() => {{"]
    parts.append(_COMMENT.sub("", body).rstrip())
    parts += [f"return {{ {', '.join(names)} }};", "})();", ""]
    exports[path] = names


def _error(path: Path, text: str, start: int, what: str) -> ValueError:
    start += len(text[start:]) - len(text[start:].lstrip())
    return ValueError(f"{path}:{text.count(chr(10), 0, start) + 1}: {what}")
