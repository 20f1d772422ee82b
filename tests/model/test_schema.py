"""Schema versions: every file that is written and read again refuses another one in one line."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pyharness import Ensemble, InputError, Listing, load, read_scene, solve, solve_many
from pyharness.checks.agree.plan import read_plan
from pyharness.checks.agree.record import read_record as read_results
from pyharness.checks.agree.record import update_record
from pyharness.checks.external_file import read_problem
from pyharness.checks.golden import read_record
from pyharness.checks.integrators import protocol
from pyharness.checks.port_protocol import request
from pyharness.checks.scenes.random_scenes import draw_moderate
from pyharness.cli.output import check_tree
from pyharness.edition.citation import PACKAGE_MARK
from pyharness.edition.report import MARK
from pyharness.model.scene_file import case_scene, scene_text
from pyharness.model.schema import SCHEMAS, check_schema
from pyharness.sweep.sweep_file import read_sweep
from pyharness.thesis.vectors import OURS, answers
from tests.checks.agree.programs import PLAN
from tests.checks.agree.programs import written as written_plan
from tests.ports import engine
from tests.sweep.sweeps import TILT, files, run_sweep, text, written

ROOT = Path(__file__).parent.parent.parent
EXTERNAL = ROOT / "pyharness" / "data" / "external" / "nasa-brick.toml"


class Reader:
    """A file with a schema number, and the function that reads it."""

    def __init__(self, path: Path, read: Callable[[], object], may_lack: bool = False) -> None:
        self.path, self.read, self.may_lack = path, read, may_lack

    def replace(self, number: str | None) -> None:
        """Give the file another number, or none."""
        content = self.path.read_text()
        pattern = r'(?m)("schema": )\d+(, ?|,?\n|$)|^(schema = )\d+\n'
        assert re.search(pattern, content)
        if number is None:
            self.path.write_text(re.sub(pattern, "", content, count=1))
        else:
            changed = re.sub(r'("schema": |^schema = )\d+', rf"\g<1>{number}", content, flags=re.M)
            self.path.write_text(changed)


def sweep_store(folder: Path) -> Reader:
    sweep = read_sweep(written(folder, text(TILT)))
    store = folder / "store"
    run_sweep(sweep, str(store))
    # A store of another version has its own checksums, which this version can't read.
    shutil.rmtree(store / "checksums")
    return Reader(store / "zarr.json", lambda: run_sweep(sweep, str(store)))


def in_toml(content: str, read: Callable[[Path], object]) -> Callable[[Path], Reader]:
    def made(folder: Path) -> Reader:
        path = folder / "x.toml"
        path.write_text(content)
        return Reader(path, lambda: read(path), may_lack=True)

    return made


class _Archive(Reader):
    """A trajectory file, which has its schema number in the text `header`."""

    def replace(self, number: str | None) -> None:
        with np.load(self.path) as file:
            arrays = dict(file)
        old, new = '"schema": 1, ', "" if number is None else f'"schema": {number}, '
        assert str(arrays["header"]).count(old) == 1
        np.savez(self.path, **{**arrays, "header": str(arrays["header"]).replace(old, new)})


def trajectory_file(folder: Path) -> Reader:
    path = folder / "found.npz"
    solve(case_scene(3), [1.0]).save(path)
    return _Archive(path, lambda: load(path))


def ensemble_file(folder: Path) -> Reader:
    path = folder / "found.npz"
    solve_many(case_scene(3), 1.0, omega=[[0.0, 1.0, 1.0]]).save(path)
    return _Archive(path, lambda: Ensemble.load(path))


def vector_file(folder: Path) -> Reader:
    path = Path(shutil.copy(OURS, folder / "vectors.json"))
    return Reader(path, lambda: answers(path))


def golden_record(folder: Path) -> Reader:
    path = Path(shutil.copy(ROOT / "tests" / "golden" / "rk4.toml", folder / "rk4.toml"))
    return Reader(path, lambda: read_record(folder))


def result_record(folder: Path) -> Reader:
    plan = read_plan(written_plan(folder, "", text='record = "r.json"\n' + PLAN))
    update_record(plan, [[[1.0, 2.0]]], "first")
    return Reader(folder / "r.json", lambda: read_results(plan))


def listed(kind: str, mark: str, *option: str) -> Callable[[Path], Reader]:
    def made(folder: Path) -> Reader:
        path = folder / mark
        path.write_text(json.dumps({"schema": SCHEMAS[kind], "files": {"LICENSE": 3}}))
        return Reader(path, lambda: check_tree(str(folder), mark, *option))

    return made


def _request(folder: Path, line: bytes, command: list[str], field: str) -> Reader:
    """Return a request and a process of the documents that answers it with a `field`."""
    path = folder / "request"
    path.write_bytes(line + b"\n")

    def read() -> None:
        found = subprocess.run(command, input=path.read_text(), capture_output=True, text=True)
        if found.returncode:
            assert found.stderr.count("\n") == 1, found.stderr
            raise InputError(found.stderr)
        assert json.loads(found.stdout)[field]

    return Reader(path, read)


def port_request(folder: Path) -> Reader:
    line = request(case_scene(1), Listing.original("two-term"))
    return _request(folder, line, ["node", str(ROOT / "web" / "port.js")], "rows")


def integrator_request(folder: Path) -> Reader:
    line = protocol.request(draw_moderate("schema", "free", 0), [1.0], 0.5, 1e-6)
    command = [sys.executable, str(ROOT / "docs/how-to/integrator/rk4.py")]
    return _request(folder, line, command, "omega")


FILES: dict[str, Callable[[Path], Reader]] = {
    "sweep store": sweep_store,
    "sweep file": in_toml("schema = 1\n" + text(TILT), read_sweep),
    "scene file": in_toml(scene_text(case_scene(3)), read_scene),
    "trajectory file": trajectory_file,
    "ensemble file": ensemble_file,
    "external file": in_toml("schema = 1\n" + EXTERNAL.read_text(), read_problem),
    "vector file": vector_file, "golden record": golden_record,
    "result record": result_record,
    "edition": listed("edition", MARK, "--out"),
    "data package": listed("data package", PACKAGE_MARK, "--data", "data package"),
    "port request": port_request, "integrator request": integrator_request,
}  # fmt: skip


def test_every_kind_is_tried() -> None:
    assert FILES.keys() == SCHEMAS.keys()


@pytest.mark.campaign
@pytest.mark.parametrize("kind", FILES)
def test_another_schema_is_refused_in_a_line(kind: str, tmp_path: Path) -> None:
    if kind == "port request":
        engine()
    reader = FILES[kind](tmp_path)
    content = reader.path.read_bytes()
    if kind != "sweep store":  # its checksums were removed
        reader.read()
    known = SCHEMAS[kind]
    for number in (str(known + 1), str(known - 1), "-1", f"{known}.0", '"1"', "true", None):
        reader.path.write_bytes(content)
        reader.replace(number)
        assert reader.path.read_bytes() != content
        if kind == "port request" and number == "1.0":
            continue  # the same number in JavaScript
        if number is None and reader.may_lack:
            reader.read()
            continue
        before = files(tmp_path)
        words = rf"schema.*; this (version|port|integrator) reads schema {known} of an? {kind}"
        with pytest.raises(InputError, match=words) as caught:
            reader.read()
        assert "\n" not in str(caught.value)
        assert files(tmp_path) == before


def test_numbers_are_those_of_the_document() -> None:
    page = (ROOT / "docs/reference/output.md").read_text()
    rows = re.findall(r"^\| ([a-z ]+) \| (\d+) \|", page, flags=re.M)
    assert {kind: int(number) for kind, number in rows} == SCHEMAS


def test_number_of_any_kind_is_a_line() -> None:
    for found in (None, 10**5000, -1, 1.0, True, "1", [1], {"a": 1}, float("nan")):
        with pytest.raises(InputError, match=r"^x: schema"):
            check_schema("x", "scene file", found, "give another")
    check_schema("x", "scene file", SCHEMAS["scene file"], "give another")
