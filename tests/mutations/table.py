"""The table: one change to one file a row, and the record of what caught each."""

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parent.parent.parent
FOLDER = Path(__file__).parent
CAUGHT = FOLDER / "caught.toml"
REASONS = ("equivalent: ", "harmless: ", "open: ")


@dataclass(frozen=True)
class Row:
    """A change."""

    id: str  # the file without its ending, and a name
    file: str  # relative to the checkout
    old: str  # stands there exactly once
    new: str
    lives: str | None = None  # why nothing catches it: one of REASONS, and the reason
    # The check that caught it: a test by pytest's name, or `verify` and the name of a check;
    # "time-out " before it where it never ended.
    killer: str | None = None

    @property
    def compiled(self) -> bool:
        """Whether the change asks for a build."""
        return self.file.startswith("fortran/")

    @property
    def is_equivalent(self) -> bool:
        """Whether it changes nothing that anyone could see."""
        return self.killer is None and (self.lives or "").startswith("equivalent: ")

    def applied(self, text: str) -> str:
        """Return the file with the change in it; ValueError where it does not apply."""
        if (count := text.count(self.old)) != 1:
            raise ValueError(f"{self.id}: {self.old!r} stands {count} times in {self.file}")
        return text.replace(self.old, self.new)


def rows(folder: Path = FOLDER) -> list[Row]:
    """Read the table: by file, name = [old, new] or [old, new, why it lives]."""
    caught = tomllib.loads(CAUGHT.read_text()) if CAUGHT.exists() else {}
    found = []
    for path in sorted(folder.glob("table-*.toml")):
        for file, changes in tomllib.loads(path.read_text()).items():
            for name, (old, new, *reason) in changes.items():
                id = f"{PurePosixPath(file).with_suffix('')}/{name}"
                lives = reason[0] if reason else None
                found.append(Row(id, file, old, new, lives, caught.get(id)))
    return found


def chosen(table: list[Row], patterns: list[str]) -> list[Row]:
    """Return the rows whose name has one of the patterns in it; all where there is none."""
    if not patterns:
        return table
    return [row for row in table if any(fnmatchcase(row.id, f"*{each}*") for each in patterns)]


def page(table: list[Row]) -> str:
    """Return the score and all that nothing catches, as Markdown."""
    alive = [row for row in table if row.killer is None]
    caught, faults = len(table) - len(alive), len(table) - sum(row.is_equivalent for row in alive)
    lines = [
        f"{len(table)} changes, {sum(row.compiled for row in table)} of them in compiled sources: "
        f"{caught} are caught,",
        f"{100.0 * caught / len(table):.1f} % of all, {100.0 * caught / faults:.1f} % of the "
        f"{faults} that are not equivalent. {len(alive)} are not:",
        "",
        "| not caught | why |",
        "|---|---|",
    ]
    lines += [f"| {row.id} | {row.lives or '-'} |" for row in alive]
    return "\n".join(lines) + "\n"


def update(news: dict[str, str | None], path: Path = CAUGHT) -> None:
    """Write what caught these rows, None where nothing did, into the record."""
    caught = tomllib.loads(path.read_text()) if path.exists() else {}
    killers = {id: each for id, each in {**caught, **news}.items() if each is not None}
    lines = [f"{_quoted(id)} = {_quoted(killers[id])}\n" for id in sorted(killers)]
    head = "# What caught each row, tried first: written by `make mutate ARGS=--update`.\n"
    path.write_text(head + "".join(lines))


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
