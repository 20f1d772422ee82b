"""Schema numbers of the files that this project writes and reads.

The files are listed in docs/reference/formats.md.
"""

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

The number is raised whenever the old reader would misread a file of the new form, or the new reader
a file of the old form.
"""


def check_schema(where: str, kind: str, found: object, remedy: str) -> None:
    """Raise InputError if a file has another schema than the one that this version reads.

    Parameters
    ----------
    where : str
        Name of the file for a message, as in "scene file 'a.toml'".
    kind : str
        Kind of the file, a key of `SCHEMAS`.
    found : object
        The number of the file's schema; None if it has no number. In a file that people write the
        number may be missing; the caller then passes the number in `SCHEMAS`.
    remedy : str
        What the user can do, the last part of the message.

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
