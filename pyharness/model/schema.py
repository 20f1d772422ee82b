"""The versions of files that this project writes and reads again (docs/formats.md lists them)."""

from pyharness.model.errors import InputError, kind_of

SCHEMAS = {
    "sweep store": 2,
    "sweep file": 1,
    "scene file": 1,
    "external file": 1,
    "vector file": 1,
    "golden record": 1,
    "edition": 1,
    "port request": 1,
}
"""The number of the schema that this version writes and reads, by the kind of file.

It is raised whenever a file of the new form would be misread by the old reader, or the other way
round.
"""


def check_schema(where: str, kind: str, found: object, remedy: str) -> None:
    """Refuse a file that has another schema than the one that this version reads.

    Parameters
    ----------
    where : str
        How the file was named to us, as in "scene file 'a.toml'".
    kind : str
        Its kind, one of `SCHEMAS`.
    found : object
        The number of its schema; None where it has none. A file that people write may leave it out:
        for that, give the number of `SCHEMAS`.
    remedy : str
        What the user can do.

    Raises
    ------
    InputError
        Where the two differ, or `found` is no whole number.
    """
    known = SCHEMAS[kind]
    if type(found) is int and found == known:
        return
    if found is None:
        problem = "schema is missing"
    elif type(found) is int:
        problem = f"schema {found}" if abs(found) < 10**9 else "schema of many digits"
    else:
        problem = f"schema is {kind_of(found)}"
    raise InputError(f"{where}: {problem}; this version reads schema {known} of a {kind}; {remedy}")
