"""Compiled leaves against the interpreter and the series in decimal arithmetic, and their cache."""

import os
import pickle
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from ctypes import CDLL, c_double, c_void_p
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, principal, solve, solve_many, torques
from pyharness.checks.scenes.state_scenes import READY, draw, draw_ready
from pyharness.engine.system import leaf_cache
from pyharness.engine.system.lane_leaves import whole_source
from pyharness.engine.system.leaf_text import rule_of, structure
from pyharness.engine.system.leaves import HEADER
from pyharness.engine.system.recorded import kernel_tape, listing, system_of, taylor_step
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.arithmetic import PROBE, REFUSED
from pyharness.model.codes import Statuses
from pyharness.model.constant_body import with_constant_body
from pyharness.model.extension import extension
from pyharness.model.recurrences import OPERATIONS, WAVE
from pyharness.model.symbols import SYMBOLS
from pyharness.truth.reference import reference
from tests.conftest import Patch
from tests.instruction_sets import CHOSEN, levels_here

MOMENTS = (1.0, 1.2, 1.5)


def every_function(t: Any, w: Any) -> Any:
    """Return a torque with every operation that has leaves."""
    x = 0.3 * w[0] + 0.1 * t
    small, large = 0.1 * x, 2.0 + x * x
    others = [
        function(large if kind in ("acosh", "cbrt") or "log" in kind else small)
        for kind, function in SYMBOLS.elementary.items()
    ]
    return [
        np.exp(-x) * np.sin(2.0 * x) - w[0] / (2.0 + w[1] * w[1]),
        np.sqrt(1.0 + x * x) * np.log(2.0 + x * x) + np.tanh(w[1]) * np.cos(0.7 * t),
        np.sum(others) - w[2] * np.sqrt(w @ w) + np.cos(2.0 * w[2]),
    ]


def simple(t: Any, w: Any) -> Any:
    """Return a torque that is compiled fast."""
    return -w * w[0]


def scene_of(torque: Any = every_function, **own: Any) -> Scene:
    return Scene("leaves", (0.3, 0.2, 0.9), MOMENTS, torque=torque, **own)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: Patch) -> Path:
    """Return the folder of the cache, which is missing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return leaf_cache.folder()


@pytest.fixture
def fresh() -> Iterator[None]:
    """Let a test name another compiler."""
    leaf_cache.compiler.cache_clear()
    leaf_cache.machine.cache_clear()
    yield
    leaf_cache.compiler.cache_clear()
    leaf_cache.machine.cache_clear()


def terms(scene: Scene, address: int, h: float) -> Any:
    """Return the terms of a step `h` (s), interpreted, or by the leaves at an address."""
    array = kernel_tape(system_of(with_constant_body(scene))).copy()
    array[7:8].view(np.int64)[:] = address
    state = np.array([*scene.omega, *(scene.attitude or ())])
    return taylor_step(array, 0.4, state, np.full(len(state), 1e-9), 1e-12, abs(h), 0.4 + h).terms


def scenes(number: int) -> Scene:
    """Return a random scene without switches, about principal axes."""
    source_ = Random(f"leaves {number}")
    drawn = draw_ready(source_, READY) if number % 2 else draw(source_, ("mixed", "decay", "drag"))
    if number:
        return principal(drawn[0])[0]
    table = torques.table([0.0, 0.3, 1.0, 2.0], np.arange(12.0).reshape(4, 3) ** 2, "cubic")
    torque = torques.recorded(every_function) + table
    return scene_of(torque, attitude=(1.0, 0.2, 0.3, 0.4))


@pytest.mark.parametrize("number", range(5))
def test_terms_are_those_of_the_interpreter(number: int) -> None:
    scene = scenes(number)
    address, leaves = leaf_cache.leaves_of(system_of(with_constant_body(scene)))
    assert leaves == "compiled"
    h = 1e-2 / max(map(abs, scene.omega))
    interpreted, compiled = terms(scene, 0, h), terms(scene, address, h)
    assert compiled.shape == interpreted.shape
    difference, sizes = np.abs(compiled - interpreted), np.abs(interpreted)
    assert (difference <= 4.0 * np.spacing(sizes.max(axis=0))).all()
    # Rounding errors of earlier terms are larger, relative to a late term.
    assert (difference <= 200.0 * np.spacing(sizes.max(axis=1, keepdims=True))).all()
    assert (compiled != 0.0).sum() > 10


ROW = """
void set(double *to, int nodes, double h, const abreast *v)
{
  put(to, nodes, h, v[0], v[1], v[2], v[3]);
}
int apart(void) { return SIZE; }
"""


@pytest.mark.external
@pytest.mark.parametrize("nodes", [2, 4])
@pytest.mark.parametrize("h", [0.5, -0.1, np.inf])
def test_a_row_of_the_jacobian_is_stored_at_each_node(nodes: int, h: float, folder: Path) -> None:
    library = CDLL(str(leaf_cache.compiled_file(folder, HEADER + ROW + PROBE)))
    memory = np.full(library.apart() * 4 + 24, 7.0)
    memory = memory[-memory.ctypes.data // 8 % 4 :]  # begins with a register
    columns, to = memory[:16].reshape(4, 4), memory[16:]
    columns[:] = np.random.default_rng(nodes).normal(size=(4, 4))
    library.set(to.ctypes.data_as(c_void_p), nodes, c_double(h), columns.ctypes.data_as(c_void_p))
    for node in range(4):
        stored = to[node * library.apart() :][:4].tolist()
        assert stored == ((h * columns[:, node]).tolist() if node < nodes else [7.0] * 4)
    assert (to != 7.0).sum() == 4 * nodes


def test_every_operation_is_compared() -> None:
    operations = listing(system_of(with_constant_body(scenes(0)))).operations
    compared = [rule_of(each) for each in operations if each[0] in OPERATIONS]
    assert all(rule in compared for rule in OPERATIONS.values())
    assert {kind for kind, *_ in operations} >= OPERATIONS.keys() - {WAVE}


ROUNDED = {
    "products": lambda t, w: 3.0 + 2.0 * w[::-1] * w - 5.0 * w * w * w,
    "quotients": lambda t, w: 9.0 / (1.0 + w[::-1] * w[::-1]) - 5.0 * w,
    "roots": lambda t, w: 6.0 * np.sqrt(1.0 + w[::-1] * w[::-1]) - 9.0 * w,
    "exponentials": lambda t, w: 5.0 * np.exp(-w[::-1]) - 2.0 * w,
    "tangents": lambda t, w: 5.0 * np.tanh(w[::-1]) - 2.0 * w - 5.0 * np.arctan(w - 1.0),
    "sines": lambda t, w: 5.0 * np.sin(w[::-1]) - 2.0 * w + 5.0 * np.cos(w),
    "functions": lambda t, w: 5.0 * np.expm1(-w[::-1]) - 2.0 * w - 3.0 * np.arccosh(2.0 + w * w),
    "waves": lambda t, w: 9.0 * np.sin(50.0 * t) * w[::-1] + np.cos(40.0 * t) - 2.0 * w,
}


@pytest.mark.parametrize("name", ROUNDED)
def test_rounding_errors_are_those_of_the_interpreter(name: str) -> None:
    scene = scene_of(ROUNDED[name])
    errors = []
    for compiled in (False, True):
        # The tolerance is so small that rounding causes most of the error.
        solver = prepare(scene, tolerance=1e-14, compiled=compiled)
        solver(scene.omega, 3.0)
        omega = start_many(scene, 5)
        found: Any = solve_many(
            scene, 3.0, omega=omega, tolerance=1e-12, estimates=True, compiled=compiled
        )
        assert found.has_result.all()
        errors.append([solver.error, *found.error])
    assert errors[1] == pytest.approx(errors[0], rel=1e-3, abs=0.0)


def test_a_root_of_a_rounded_zero_is_not_known() -> None:
    total = 0.7
    first = next(
        x
        for x in np.linspace(0.1, 0.2, 1000)
        if Fraction(x) - Fraction(total) - Fraction(x - total) > Fraction(4, 10**17)
    )
    omega = (first, total - first, 0.5)

    def torque(t: Any, w: Any) -> Any:
        return [0.0, 0.0, np.sqrt(w[0] + w[1] - total)]

    scene = Scene("root", omega, (1.0, 1.0, 1.0), torque=torque)
    for compiled in (False, True):
        found = solve_many(scene, 100.0, omega=[omega] * 3, tolerance=1e-9, compiled=compiled)
        assert (found.status == Statuses.SENSITIVE).all()


@pytest.mark.parametrize("attitude", [None, (1.0, 0.2, 0.3, 0.4)])
def test_growth_and_estimate_are_those_of_the_interpreter(attitude: Any) -> None:
    scene = scene_of(attitude=attitude)
    with_attitude = attitude is not None
    prepare_any: Any = prepare
    found: Any = [
        prepare_any(scene, tolerance=1e-9, attitude=with_attitude, compiled=compiled)
        for compiled in (False, True)
    ]
    states = [np.hstack(solver(scene.omega, 2.0)) for solver in found]
    assert [each.leaves for each in found] == ["interpreter", "compiled"]
    assert states[1] == pytest.approx(states[0], rel=0.0, abs=1e-12)
    assert found[1].growth == pytest.approx(found[0].growth, rel=1e-9)
    assert found[1].error == pytest.approx(found[0].error, rel=0.1, abs=0.0)
    assert states[1][:3] == pytest.approx(reference(scene, [2.0]).omega[0], rel=0.0, abs=1e-9)


def start_many(scene: Scene, n: int) -> Any:
    return np.array(scene.omega) * (1.0 + 0.2 * np.random.default_rng(9).random((n, 3)))


def assert_same(found: list[Any], texts: tuple[str, str] = ("interpreter", "compiled")) -> None:
    """Compare results of many bodies, interpreted and compiled."""
    assert tuple(each.leaves for each in found) == texts
    interpreted, compiled = found
    assert (interpreted.status == compiled.status).all()
    assert interpreted.has_result.sum() > 3
    apart = np.abs(interpreted.omega - compiled.omega).max(axis=1)
    sizes = np.abs(interpreted.omega).max(axis=1)
    has = interpreted.has_result
    assert (apart <= (interpreted.error + compiled.error) * sizes + 1e-300)[has].all()
    assert compiled.growth[has] == pytest.approx(interpreted.growth[has], rel=0.01)


@pytest.mark.usefixtures("best_level")
@pytest.mark.parametrize("number", range(4))
def test_many_bodies_are_those_of_the_interpreter(number: int) -> None:
    scene = scenes(number)
    end = 1.0 / max(map(abs, scene.omega))
    omega = start_many(scene, 19)
    both = (False, True)
    found = [solve_many(scene, end, omega=omega, estimates=True, compiled=x) for x in both]
    assert_same(found)
    if number == 0:  # compiled sums of many terms are rounded in another order
        assert (found[0].omega != found[1].omega).any()


@pytest.mark.usefixtures("best_level")
def test_leaves_have_parameters_of_each_body() -> None:
    def torque(t: Any, w: Any, *, k: float = 0.1) -> Any:
        return -k * w * np.sqrt(w @ w + 0.01) + [k, 0.0, k * k * np.sin(t)]

    scene = scene_of(torque)
    omega, k = start_many(scene, 11), np.linspace(0.1, 0.5, 11)
    moments = np.array(MOMENTS) + 0.1 * np.random.default_rng(1).random((11, 3))
    more: Any = {"parameters": {"k": k}, "moments": moments, "estimates": True}
    found = [solve_many(scene, 5.0, omega=omega, compiled=x, **more) for x in (False, True)]
    assert_same(found)
    one: Any = replace(scene, omega=tuple(omega[7]), moments=tuple(moments[7]))
    one = replace(one, torque=lambda t, w: torque(t, w, k=k[7]))
    assert found[1].omega[7] == pytest.approx(solve(one, 5.0).omega[-1], rel=1e-8)


def test_leaves_for_other_registers_are_not_used() -> None:
    scene, choose = scene_of(simple), extension().choose_instructions
    omega = start_many(scene, 9)
    if len(levels_here()) == 1:
        pytest.skip("this build or processor has one instruction set")
    try:
        choose(levels_here()[-2])
        found = [solve_many(replace(scene), 3.0, omega=omega, compiled=x) for x in (False, True)]
    finally:
        choose(CHOSEN)
    assert found[1].leaves == (
        "interpreter: the compiler does not use the registers of this processor"
    )
    assert (found[0].omega == found[1].omega).all()


def test_switches_of_many_bodies_are_interpreted() -> None:
    scene = scene_of(lambda t, w: np.where(w > 0.1, -0.1, 0.1))
    found: Any = solve_many(scene, 1.0, omega=start_many(scene, 3), compiled=True)
    assert found.leaves.startswith("interpreter: switches and torques of")


def scaled(value: Any) -> Any:
    """Return an argument with other numbers, except zeros."""
    if isinstance(value, TorqueLaw):
        return replace(value, constant=scaled(value.constant), sines=scaled(value.sines))
    if isinstance(value, (tuple, list)):
        return [scaled(each) for each in value]
    return value if value is None or isinstance(value, bool) else 1.7 * value


@pytest.mark.usefixtures("best_level")
def test_ready_torques_have_leaves_that_were_built() -> None:
    three = (0.3, 0.1, 0.2)
    for torque in (
        *(ready.function(**{key: scaled(x) for key, x in (ready.sample | own).items()})
          for ready in KINDS.values() for own in ready.leaves),
        torques.damping(0.1), torques.rate_control(three, three),
        TorqueLaw(three, sines=[(three, 2.0)], frame="space"),
    ):  # fmt: skip
        scene = scene_of(torque, attitude=(1.0, 0.0, 0.0, 0.0))
        assert prepare(scene, attitude=True).leaves == "built"
        if not scene.torque.needs_attitude:
            assert prepare(scene).leaves == "built"
    assert kernel_tape(system_of(scene_of()))[7] == 0.0


@pytest.mark.usefixtures("best_level")
def test_laws_about_space_share_leaves_that_were_built() -> None:
    random = Random(27)
    for number in range(8):
        laws = [[0.0] * 3 for _ in range(3)]
        for axis in range(3):  # at least one number of each axis
            laws[random.randrange(3)][axis] = random.gauss(0.0, 0.3)
        constant, rate, amplitude = laws
        waves = [(amplitude, random.uniform(0.3, 3.0)), ((0.0, 0.1, 0.0), 0.5), ((0.2, 0, 0), 0.9)]
        law = TorqueLaw(constant, rate, waves[: 1 + number % 3], waves[1:], frame="space")
        scene = scene_of(law, attitude=(1.0, 0.0, 0.0, 0.0))
        solver = prepare(scene, attitude=True)
        assert solver.leaves == "built"
        truth = reference(with_constant_body(scene), [2.0]).omega[0]
        assert np.hstack(solver(scene.omega, 2.0))[:3] == pytest.approx(truth, rel=0.0, abs=1e-9)
    single = TorqueLaw((0.1, 0.0, 0.0), (0.1, 0.0, 0.0), frame="space")
    assert prepare(scene_of(single, attitude=(1, 0, 0, 0)), attitude=True).leaves == "interpreter"


def test_switches_are_interpreted() -> None:
    solver = prepare(scene_of(lambda t, w: -np.clip(w, -0.1, 0.1)), compiled=True)
    assert solver.leaves == "interpreter: switches and torques of 500 operations are not compiled"
    assert solver((0.3, 0.2, 0.9), 1.0) == pytest.approx(solve(solver.scene, 1.0).omega[0])
    assert prepare(scene_of(TorqueLaw()), compiled=True).leaves is None


def test_copies_threads_and_children_solve(folder: Path) -> None:
    solver = prepare(scene_of(), compiled=True)
    wanted = solver((0.3, 0.2, 0.9), 5.0).tolist()
    written = pickle.dumps(solver)
    assert str(folder).encode() not in written
    again = pickle.loads(written)
    assert again.leaves == "compiled"
    assert again((0.3, 0.2, 0.9), 5.0).tolist() == wanted
    results: list[Any] = []
    threads = [
        threading.Thread(target=lambda: results.append(solver((0.3, 0.2, 0.9), 5.0).tolist()))
        for _ in range(8)
    ]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert results == [wanted] * 8
    child = os.fork()
    if child == 0:
        os._exit(solver((0.3, 0.2, 0.9), 5.0).tolist() != wanted)
    assert os.waitpid(child, 0)[1] == 0


# ---- The cache ----------------------------------------------------------------------------------


def compiled_once(folder: Path) -> Path:
    """Compile leaves, and return their file."""
    prepare(scene_of(simple), compiled=True)
    (found,) = folder.glob("*.so")
    return found


def test_files_are_private_and_used_again(folder: Path, monkeypatch: Patch) -> None:
    found = compiled_once(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    assert list(folder.iterdir()) == [found]
    assert leaf_cache.size() == found.stat().st_size
    leaf_cache.loaded.cache_clear()
    monkeypatch.setattr(leaf_cache, "compiled_file", None)
    assert prepare(scene_of(simple), compiled=True).leaves == "compiled"


def rewritten(file: Path, content: bytes) -> None:
    """Replace a file, which may be mapped into memory."""
    file.unlink()
    file.write_bytes(content)
    file.chmod(0o700)


def of_another_user(file: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)


def damaged(file: Path, monkeypatch: Patch) -> None:
    rewritten(file, file.read_bytes()[:-1] + b"\1")


def of_another_processor(file: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(leaf_cache, "machine", lambda: "another one")


def of_another_version(file: Path, monkeypatch: Patch) -> None:
    shape: Any = structure(listing(system_of(scene_of(simple))))
    text = whole_source(shape) + "/* newer */"
    monkeypatch.setattr(leaf_cache, "whole_source", lambda _: text)


def as_a_link(file: Path, monkeypatch: Patch) -> None:
    file.rename(file.parent.parent / file.name)
    file.symlink_to(file.parent.parent / file.name)


def in_a_linked_folder(file: Path, monkeypatch: Patch) -> None:
    file.parent.rename(file.parent.parent / "elsewhere")
    file.parent.symlink_to(file.parent.parent / "elsewhere")


def a_folder(file: Path, monkeypatch: Patch) -> None:
    file.unlink()
    file.mkdir()


HOSTILE: dict[str, Callable[[Path, Patch], Any]] = {
    "another user": of_another_user,
    "another processor": of_another_processor,
    "another version": of_another_version,
    "a link": as_a_link,
    "a linked folder": in_a_linked_folder,
    "damaged": damaged,
    "truncated": lambda file, _: rewritten(file, file.read_bytes()[:1000]),
    "empty": lambda file, _: rewritten(file, b""),
    "writable by all": lambda file, _: file.chmod(0o702),
    "writable by a group": lambda file, _: file.chmod(0o720),
    "a folder writable by all": lambda file, _: file.parent.chmod(0o702),
    "a folder writable by a group": lambda file, _: file.parent.chmod(0o770),
    "another name": lambda file, _: file.rename(file.with_name(file.name[:-4] + "x.so")),
    "a folder": a_folder,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_never_loaded(name: str, folder: Path, monkeypatch: Patch) -> None:
    file = compiled_once(folder)
    leaf_cache.loaded.cache_clear()
    HOSTILE[name](file, monkeypatch)
    hostile = set()
    for number, path in enumerate(folder.parent.parent.rglob("*.so")):
        if path.is_file():
            # A second name keeps the number of the file from being used again.
            os.link(path.resolve(), folder.parent.parent / f"kept-{number}")
            hostile.add(path.stat().st_ino)
    opened: list[int] = []
    library = leaf_cache.CDLL

    def watched(path: str) -> Any:
        opened.append(os.stat(path).st_ino)
        return library(path)

    monkeypatch.setattr(leaf_cache, "CDLL", watched)
    solver = prepare(scene_of(simple), compiled=True)
    assert hostile.isdisjoint(opened)
    assert solver((0.3, 0.2, 0.9), 1.0) == pytest.approx(solve(solver.scene, 1.0).omega[0])
    if name in ("another user", "a linked folder") or name.startswith("a folder writable"):
        reason = f"{folder} is not the user's own folder, or others may write it"
        assert solver.leaves == f"interpreter: {reason}"
    elif name != "a folder":
        assert solver.leaves == "compiled"


def script(folder: Path, text: str) -> str:
    """Return a program that runs as a compiler."""
    folder.parent.mkdir(exist_ok=True)
    path = folder.parent / "cc-test"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


COMPILERS = {
    "missing": "/nonexistent/cc",
    "with an open quotation": 'cc "',
    "failing": "echo 'no room on the disk' >&2; exit 1",
    "silent": "exit 3",
    "killed": "kill -9 $$",
    "without a result": "exit 0",
    "with garbage": 'for last; do :; done; case "$last" in -*) shift $(($# - 2)); last=$1;; esac; '
    'echo garbage > "$last"',
}


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("name", COMPILERS)
def test_without_a_working_compiler_the_interpreter_solves(
    name: str, folder: Path, monkeypatch: Patch
) -> None:
    command = COMPILERS[name]
    if name == "missing":
        monkeypatch.setenv("PATH", "")
    elif name != "with an open quotation":
        command = script(folder, command)
    monkeypatch.setenv("CC", command)
    assert leaf_cache.about_leaves()["bytes"] == 0
    solver = prepare(scene_of(simple), compiled=True)
    assert str(solver.leaves).startswith("interpreter: ")
    assert ("CC is" in str(solver.leaves)) == (name == "with an open quotation")
    assert "\n" not in str(solver.leaves)
    assert solver((0.3, 0.2, 0.9), 1.0) == pytest.approx(solve(solver.scene, 1.0).omega[0])
    assert not [each for each in folder.glob("*") if not each.name.endswith(".so")]


# A sphere whose omega (rad/s) is subnormal.
TINY = Scene("tiny", (1e-310, 0.0, 0.0), (1.0, 1.0, 1.0))


@pytest.mark.external
@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize(
    ("flag", "is_wrapped"),
    [("-ffast-math", False), ("-ffast-math", True), ("-funsafe-math-optimizations", True),
     ("-fno-signed-zeros", True), ("-mrecip", False)],
)  # fmt: skip
def test_a_compiler_that_changes_the_arithmetic_is_refused(
    flag: str, is_wrapped: bool, folder: Path, monkeypatch: Patch
) -> None:
    """Also if its options are not seen; code linked with some would change the whole process."""
    command = script(folder, f'exec cc {flag} "$@"') if is_wrapped else f"cc {flag}"
    monkeypatch.setenv("CC", command)
    options = f"options such as {', '.join(REFUSED[:7])}" if is_wrapped else flag
    reason = f" changes the arithmetic: leave out {options}"
    assert str(leaf_cache.about_leaves()["compiler"]).endswith(reason)
    solver = prepare(scene_of(simple), compiled=True)
    assert str(solver.leaves).startswith("interpreter: ")
    assert str(solver.leaves).endswith(reason)
    assert solve(TINY, 1.0).omega[0, 0] == 1e-310
    assert 0.5 * sys.float_info.min > 0.0


@pytest.mark.external
@pytest.mark.usefixtures("fresh")
def test_leaves_of_another_compiler_are_not_loaded(folder: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("CC", "cc -g")
    assert prepare(scene_of(simple), compiled=True).leaves == "compiled"
    leaf_cache.compiler.cache_clear()
    leaf_cache.machine.cache_clear()
    leaf_cache.loaded.cache_clear()
    monkeypatch.setenv("CC", "cc -g -ffinite-math-only")
    assert "leave out -ffinite-math-only" in str(prepare(scene_of(simple), compiled=True).leaves)


def no_room(*_: Any, **__: Any) -> None:
    raise OSError(28, "No space left on device")


def too_slow(*_: Any, **__: Any) -> None:
    raise subprocess.TimeoutExpired("cc", 60.0)


@pytest.mark.parametrize("what", ["mkdir", "write_text", "replace", "load", "slow", "file"])
def test_without_room_or_rights_the_interpreter_solves(
    what: str, folder: Path, monkeypatch: Patch
) -> None:
    if what == "load":
        monkeypatch.setattr(leaf_cache, "CDLL", no_room)  # as on a disk that is mounted noexec
    elif what == "slow":
        monkeypatch.setattr(subprocess, "run", too_slow)
    elif what == "file":
        folder.parent.write_text("in the place of the folder")
    else:
        monkeypatch.setattr(Path, what, no_room)
    solver = prepare(scene_of(simple), compiled=True)
    assert str(solver.leaves).startswith("interpreter: ")
    assert solver((0.3, 0.2, 0.9), 1.0) == pytest.approx(solve(solver.scene, 1.0).omega[0])
    if what != "file":
        assert not list(folder.glob("new-*"))


def test_two_processes_compile_at_once(folder: Path, tmp_path: Path) -> None:
    code = (
        "from pyharness import Scene, prepare\n"
        "def torque(t, w): return [-w[0]*w[1]/(1 + t*t), -w[1], -w[2]]\n"
        "scene = Scene('two', (0.3, 0.2, 0.9), (1, 1.2, 1.5), torque=torque)\n"
        "print(prepare(scene, compiled=True).leaves)"
    )
    both = [
        subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=tmp_path
        )
        for _ in "ab"
    ]
    assert [each.communicate()[0] for each in both] == ["compiled\n"] * 2
    assert len(list(folder.glob("*.so"))) == 1


def test_the_folder_is_limited_and_cleaned(folder: Path, monkeypatch: Patch) -> None:
    file = compiled_once(folder)
    left = folder / "new-killed"
    left.mkdir()
    os.utime(left, (1, 1))
    os.utime(file, (0, 0))  # older than the folder
    outside = folder.parent / "outside" / "mine"
    outside.parent.mkdir()
    outside.touch()
    (folder / "new-link").symlink_to(outside.parent)
    os.utime(folder / "new-link", (1, 1), follow_symlinks=False)
    monkeypatch.setattr(leaf_cache, "MOST_BYTES", 100)
    prepare(scene_of(lambda t, w: -w * w[1]), compiled=True)
    assert not left.exists()
    assert not file.exists()
    assert outside.exists()
    assert len(list(folder.iterdir())) == 2  # the new code and the link
