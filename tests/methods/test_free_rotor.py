"""The header free_rotor.h: compiled as a user would, and compared with kernel and exact series."""

import ctypes
import importlib.util
import os
import random
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import get_include
from pyharness.model.extension import extension
from pyharness.scenes.free_motions import KINDS, draw
from tests.attitude_errors import largest_error
from tests.exact_attitude import exact

_ROOT = Path(__file__).parents[2]
_SOURCE = Path(__file__).with_name("free_rotor.c")
_GUIDE = _ROOT / "docs/how-to/free-rotor"
_FLAGS = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{get_include()}"]
_CC = shlex.split(os.environ.get("CC", "cc"))
_ZIG = [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None
_OK, _INVALID, _RANGE, _PHASE, _OVERFLOW = range(5)

# Largest differences from the kernel: measured 7e-16 and 6e-6 on 4,000 scenes.
_BOUNDS = {"binary64": 5e-15, "binary32": 2e-5}
_REAL: dict[str, Any] = {"binary64": np.float64, "binary32": np.float32}


def compiled(
    target: Path, source: Path = _SOURCE, flags: Sequence[str] = (), cc: Any = _CC
) -> Path:
    """Compile a C program with every warning as an error."""
    subprocess.run([*cc, *_FLAGS, *flags, str(source), "-o", str(target), "-lm"], check=True)
    return target


def output_of(command: Sequence[str | Path]) -> str:
    return subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    target = tmp_path_factory.mktemp("free_rotor") / "free_rotor.so"
    return ctypes.CDLL(str(compiled(target, flags=["-shared", "-fPIC"])))


def states(library: Any, word: str, scenes: Any) -> tuple[Any, Any]:
    """Return the states of scenes (moments, omega, attitude, time) and how each ended."""
    scenes = np.ascontiguousarray(scenes, _REAL[word])
    parts = [np.ascontiguousarray(scenes[:, a:b]) for a, b in ((0, 3), (3, 6), (6, 10), (10, 11))]
    found = np.full((len(scenes), 7), np.nan, _REAL[word])
    ended = np.empty(len(scenes), np.intc)
    function = library.batch if word == "binary64" else library.batchf
    function(len(scenes), *[ctypes.c_void_p(x.ctypes.data) for x in (*parts, found, ended)])
    return found.astype(float), ended


def of_kernel(scenes: Any) -> tuple[Any, Any]:
    found, ended = np.full((len(scenes), 7), np.nan), np.empty(len(scenes), int)
    for i, scene in enumerate(scenes):
        rows, attitudes, n_rows, ended[i] = extension().torque_free_attitude_solution(
            scene[:3], scene[3:6], scene[6:10], scene[10:]
        )
        if n_rows == 1:
            found[i] = [*rows[:, 0], *attitudes[:, 0]]
    return found, ended


def drawn(count: int, seed: str) -> Any:
    """Return `count` scenes of each kind of body, with times up to 1e6 s."""
    source = random.Random(seed)
    motions = [draw(source, kind) for kind in KINDS for _ in range(count)]
    return np.array([[*moments, *omega, *q, time] for moments, omega, q, time in motions])


def difference(found: Any, wanted: Any, scenes: Any) -> Any:
    """Return the largest difference of each scene; that of omega is relative to its largest."""
    size = np.maximum(np.abs(scenes[:, 3:6]).max(1), np.abs(wanted[:, :3]).max(1))
    omega = np.abs(found - wanted)[:, :3].max(1) / np.where(size > 0.0, size, 1.0)
    return np.maximum(omega, np.abs(found - wanted)[:, 3:].max(1))


@pytest.mark.parametrize("word", _BOUNDS)
def test_header_agrees_with_the_kernel(word: str, library: Any) -> None:
    scenes = drawn(400, "kernel")
    if word == "binary32":
        scenes[:, 10] = np.clip(scenes[:, 10], -1e3, 1e3)
        scenes = scenes.astype(np.float32).astype(float)
        scenes = scenes[np.isin(of_kernel(scenes)[1], 0)]
    found, ended = states(library, word, scenes)
    wanted, kernel_ended = of_kernel(scenes)
    assert len(scenes) > 2000
    # The phase of needles, with moments in the ratio of 1e9, is too large for binary32.
    too_long = ended == (_PHASE if word == "binary32" else -1)
    assert np.array_equal((ended == _OK) | too_long, kernel_ended == 0)
    complete = ended == _OK
    assert complete.mean() > 0.9
    errors = difference(found[complete], wanted[complete], scenes[complete])
    assert errors.max() < _BOUNDS[word]


@pytest.mark.parametrize("kind", KINDS)
def test_header_agrees_with_exact_series(kind: str, library: Any) -> None:
    source = random.Random(kind)
    for _ in range(4):
        moments, omega, attitude, time = draw(source, kind)
        found, ended = states(library, "binary64", [[*moments, *omega, *attitude, time]])
        assert ended[0] == _OK
        exact_omega, exact_attitude = exact(moments, omega, attitude, time)
        size = max(*map(abs, omega), *(abs(float(x)) for x in exact_omega)) or 1.0
        assert largest_error(found[0, :3], exact_omega) < 2e-14 * size
        assert largest_error(found[0, 3:], exact_attitude) < 2e-15


def test_scale_of_moments_and_omega_does_not_matter(library: Any) -> None:
    scenes = drawn(20, "scales")
    found, _ = states(library, "binary64", scenes)
    for moments, omega in ((2.0**-490, 1.0), (2.0**490, 2.0**490), (1.0, 2.0**-490)):
        scaled = scenes.copy()
        scaled[:, :3] *= moments
        scaled[:, 3:6] *= omega
        scaled[:, 10] /= omega
        again, ended = states(library, "binary64", scaled)
        again[:, :3] /= omega
        complete = ended == _OK
        assert complete.mean() > 0.9
        assert difference(again[complete], found[complete], scenes[complete]).max() < 1e-14


def test_arbitrary_bits_agree_with_the_kernel(library: Any) -> None:
    generator = np.random.default_rng(3)
    bits = generator.integers(0, 2**64, (10000, 11), dtype=np.uint64).view(float)
    plain = generator.random(bits.shape)
    scenes = np.where(plain < 0.6, generator.uniform(-1.0, 1.0, bits.shape), bits)
    scenes = np.where(plain > 0.97, generator.choice([0.0, 1.0, -1.0, 2.0], bits.shape), scenes)
    scenes[::2, :3] = np.abs(scenes[::2, :3])
    found, ended = states(library, "binary64", scenes)
    wanted, kernel_ended = of_kernel(scenes)
    finite = np.isfinite(scenes[:, 10])
    # Bodies of two equal moments are left out: the kernel reports an overflow for some.
    own = finite & (scenes[:, 0] != scenes[:, 1]) & (scenes[:, 1] != scenes[:, 2])
    own &= scenes[:, 0] != scenes[:, 2]
    assert np.array_equal(ended[own] == _OK, kernel_ended[own] == 0)
    assert (ended[~finite] != _OK).all()
    assert np.isnan(found[ended != _OK]).all()
    both = (ended == _OK) & (kernel_ended == 0)
    assert both.sum() > 500
    assert difference(found[both], wanted[both], scenes[both]).max() < 1e-9


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [(0, 0.0, _INVALID), (1, -1.0, _INVALID), (2, np.nan, _INVALID), (3, np.inf, _INVALID),
     (6, np.nan, _INVALID), (10, np.inf, _INVALID), (0, 1e-40, _RANGE), (10, 1e16, _PHASE)],
)  # fmt: skip
def test_status_says_what_is_wrong(place: int, value: float, status: int, library: Any) -> None:
    scene = np.array([[3.0, 2.0, 1.2, 0.3, 1.1, -0.7, 1.0, 0.0, 0.0, 0.0, 2.5]])
    assert states(library, "binary64", scene)[1][0] == _OK
    scene[0, place] = value
    found, ended = states(library, "binary64", scene)
    assert ended[0] == status
    assert np.isnan(found).all()


def test_zero_quaternion_and_overflow_are_refused(library: Any) -> None:
    scene = np.array([[3.0, 2.0, 1.2, 0.3, 1.1, -0.7, 0.0, 0.0, 0.0, 0.0, 2.5]])
    assert states(library, "binary64", scene)[1][0] == _INVALID
    # The energy of axis 2 takes omega about axis 1, with its small moment, above 1.8e308.
    scene[0, :7] = [1e-3, 0.5, 1.0, 1e307, 1.7e308, 1e307, 1.0]
    times = np.linspace(0.0, 2e-307, 50)
    ended = states(library, "binary64", [[*scene[0, :10], t] for t in times])[1]
    assert set(ended) == {_OK, _OVERFLOW}


def steps(library: Any, word: str, scene: Any, dt: float, count: int, compensated: bool) -> Any:
    """Return the state after `count` steps, with what was compensated added."""
    moments = np.array(scene[:3], _REAL[word])
    state, rest = np.array(scene[3:10], _REAL[word]), np.zeros(7, _REAL[word])
    function = library.batch_steps if word == "binary64" else library.batchf_steps
    real = ctypes.c_double if word == "binary64" else ctypes.c_float
    given = [ctypes.c_void_p(each.ctypes.data) for each in (moments, state, rest)]
    last = given[2] if compensated else None
    assert function(ctypes.c_int(count), given[0], real(dt), given[1], last) == _OK
    return state.astype(float) + rest


@pytest.mark.parametrize("dt", [0.7, 0.25, 0.06, -0.01, 1e-4, 1e-300])
def test_one_step_is_the_closed_form(dt: float, library: Any) -> None:
    scenes = drawn(6, "steps")
    speed = np.abs(scenes[:, 3:6]).max(1)
    scenes[:, 10] = dt / np.where(speed > 0.0, speed, 1.0)
    wanted, ended = states(library, "binary64", scenes)
    complete = ended == _OK
    found = np.array(
        [steps(library, "binary64", s[:10], s[10], 1, False) for s in scenes[complete]]
    )
    assert difference(found, wanted[complete], scenes[complete]).max() < 2e-14


@pytest.mark.parametrize(
    ("word", "compensated", "bound"),
    [("binary64", False, 3e-13), ("binary64", True, 3e-15),
     ("binary32", False, 1e-4), ("binary32", True, 5e-7)],
)  # fmt: skip
def test_steps_do_not_drift(word: str, compensated: bool, bound: float, library: Any) -> None:
    scene = np.array([3.0, 2.0, 1.25, 0.25, 1.125, -0.75, 1.0, 0.0, 0.0, 0.0])
    last = steps(library, word, scene, 1e-3, 200_000, compensated)
    energy, momentum = invariants(scene[:3], last)
    energy0, momentum0 = invariants(scene[:3], scene[3:])
    assert abs(energy / energy0 - 1.0) < bound
    assert np.linalg.norm(momentum - momentum0) < bound * np.linalg.norm(momentum0)
    assert abs(np.linalg.norm(last[3:]) - 1.0) < (1e-15 if word == "binary64" else 3e-7)


def invariants(moments: Any, state: Any) -> tuple[float, Any]:
    """Return twice the energy and the angular momentum in space."""
    body, q = moments * state[:3], state[3:] / np.linalg.norm(state[3:])
    turned = np.cross(q[1:], body)
    return state[:3] @ body, body + 2.0 * (q[0] * turned + np.cross(q[1:], turned))


def test_arbitrary_bits_under_sanitizers(tmp_path: Path) -> None:
    flags = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    empty = tmp_path / "empty.c"
    empty.write_text("int main(void) { return 0; }\n")
    try:
        output_of([compiled(tmp_path / "empty", empty, flags)])
    except subprocess.CalledProcessError:
        pytest.skip("the compiler has no sanitizers")
    found = output_of([compiled(tmp_path / "fuzz", flags=flags), "10000"])
    assert found.startswith("10000 inputs")


@pytest.mark.parametrize(
    "flags", [["-O0"], ["-O3", "-march=native"], ["-O2", "-ffp-contract=fast"]]
)
def test_arbitrary_bits_at_other_levels(flags: list[str], tmp_path: Path) -> None:
    found = output_of([compiled(tmp_path / "fuzz", flags=flags), "10000"])
    assert found.startswith("10000 inputs")


def test_clang_and_web_assembly(tmp_path: Path) -> None:
    clang = shutil.which("clang")
    if clang is None and _ZIG is None:
        pytest.skip("neither clang nor ziglang is installed")
    native = compiled(tmp_path / "fuzz", cc=_ZIG or [clang])
    assert output_of([native, "10000"]).startswith("10000 inputs")
    node = shutil.which("node")
    if _ZIG is None or node is None:
        pytest.skip("WebAssembly needs ziglang and node")
    built = compiled(tmp_path / "fuzz.wasm", flags=["-target", "wasm32-wasi"], cc=_ZIG)
    script = tmp_path / "run.mjs"
    script.write_text(
        'import { readFileSync } from "node:fs";\n'
        'import { WASI } from "node:wasi";\n'
        'const wasi = new WASI({ version: "preview1", args: ["fuzz", "10000"] });\n'
        "const built = await WebAssembly.compile(readFileSync(process.argv[2]));\n"
        "wasi.start(await WebAssembly.instantiate(built, wasi.getImportObject()));\n"
    )
    found = output_of([node, "--no-warnings", script, built])
    assert found.startswith("10000 inputs")


def test_header_is_cplusplus_too(tmp_path: Path) -> None:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler is found")
    source = tmp_path / "user.cc"
    source.write_text('#include "free_rotor.h"\nint main() { return 0; }\n')
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{get_include()}"]
    subprocess.run([compiler, *flags, str(source), "-o", str(tmp_path / "user")], check=True)


def test_fast_math_is_refused(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        compiled(tmp_path / "fast", flags=["-ffast-math"])


def test_benchmark_prints_a_table(tmp_path: Path) -> None:
    built = compiled(tmp_path / "benchmark", _GUIDE / "benchmark.c")
    rows = output_of([built, "1000"]).splitlines()[2:]
    errors = {row.split("|")[1].strip(" `"): float(row.split("|")[3]) for row in rows}
    assert errors["free_rotor_step"] < 1e-13
    assert errors["free_rotor_stepf"] < 1e-4
    assert 1e-5 < errors["semi-implicit Euler (MuJoCo)"] < 1e-2


def test_mujoco_drifts_and_the_header_does_not() -> None:
    pytest.importorskip("mujoco")
    script = _GUIDE / "mujoco_drift.py"
    rows = output_of([sys.executable, script, get_include()]).splitlines()
    cells = [[cell.strip(" `") for cell in row.split("|")[1:-1]] for row in rows[2:]]
    last = {name: abs(float(energy)) for name, time, energy, *_ in cells if time == "1000"}
    assert last["MuJoCo, `Euler"] > 1e-2
    assert last["free_rotor_step"] < 1e-12
