"""The versions of files that this project writes and reads again (docs/formats.md lists them)."""

from pyharness.model.errors import InputError, kind_of


def check_schema(where: str, what: str, found: object, known: int, remedy: str) -> None:
    """Refuse a file that has another schema than the one that this version reads.

    Parameters
    ----------
    where : str
        How the file was named to us, as in "scene file 'a.toml'".
    what : str
        What kind of file it should be, as in "store of a sweep".
    found : object
        The number of the file's schema; None where it has none.
    known : int
        The number that this version reads.
    remedy : str
        What the user can do.

    Raises
    ------
    InputError
        Where the two differ, or `found` is no whole number.
    """
    if type(found) is int and found == known:
        return
    if found is None:
        problem = "has no schema"
    elif type(found) is int:
        problem = f"has schema {found}"
    else:
        problem = f"has a schema that is {kind_of(found)}"
    raise InputError(f"{where}: the {what} {problem}; this version reads schema {known}: {remedy}")
