"""Schema numbers of the files that this project writes and reads.

A schema number is the version of a file format. The formats are described in
docs/reference/formats.md.
"""

from pyharness.model.errors import InputError, kind_of

SCHEMAS = {
    "sweep store": 2,
    "sweep file": 1,
    "scene file": 1,
    "trajectory file": 1,
    "external file": 1,
    "vector file": 1,
    "golden record": 1,
    "edition": 1,
    "data package": 1,
    "port request": 1,
    "integrator request": 1,
}
"""The schema number that this version of the package writes and reads, for each kind of file.

The number is increased if an old version would misread a new file, or a new version an old file.
"""


def check_schema(where: str, kind: str, found: object, remedy: str) -> None:
    """Raise InputError if a file's schema number is not the one that this version reads.

    A schema number is the version of a file format.

    Parameters
    ----------
    where : str
        The file, or the place in it, with which the message begins, as in "scene file 'a.toml'".
    kind : str
        Kind of the file, a key of `SCHEMAS`, as in "scene file".
    found : object
        The schema number in the file; None if the file has none. If the file may omit the number,
        the caller passes the number in `SCHEMAS` instead of None.
    remedy : str
        What the user can do, with which the message ends.

    Raises
    ------
    InputError
        If `found` differs from the number in `SCHEMAS`, or is not an integer.
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
