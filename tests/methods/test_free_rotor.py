"""The header free_rotor.h: compiled as a user would, and compared with kernel and exact series."""

import ctypes
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import get_include
from pyharness.scenes.free_motions import KINDS, draw
from tests.attitude_errors import largest_error
from tests.exact_attitude import exact
from tests.methods.free_rotor_campaign import (
    BOUNDS,
    INVALID,
    OK,
    OVERFLOW,
    PHASE,
    RANGE,
    command,
    compare,
    compiled,
    compiled_library,
    difference,
    drawn,
    of_kernel,
)

_ROOT = Path(__file__).parents[2]
_REAL: dict[str, Any] = {"binary64": np.float64, "binary32": np.float32}
_GUIDE = _ROOT / "docs/how-to/free-rotor"


def output_of(command: Sequence[str | Path]) -> str:
    return subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return compiled_library(tmp_path_factory.mktemp("free_rotor"))


def states(library: Any, word: str, scenes: Any) -> tuple[Any, Any]:
    """Return the library's states of scenes (moments, omega, attitude, time), and its codes."""
    scenes = np.ascontiguousarray(scenes, _REAL[word])
    parts = [np.ascontiguousarray(scenes[:, a:b]) for a, b in ((0, 3), (3, 6), (6, 10), (10, 11))]
    found = np.full((len(scenes), 7), np.nan, _REAL[word])
    ended = np.empty(len(scenes), np.intc)
    function = library.batch if word == "binary64" else library.batchf
    function(len(scenes), *[ctypes.c_void_p(x.ctypes.data) for x in (*parts, found, ended)])
    return found.astype(float), ended


@pytest.mark.parametrize("target", ["cc", "clang", "wasm"])
def test_header_agrees_with_the_kernel(target: str, tmp_path: Path) -> None:
    program = command(target, tmp_path)
    if program is None:
        pytest.skip("clang and WebAssembly need the package ziglang, or clang and node")
    assert output_of([*program, "10000"]).startswith("10000 inputs")
    for tally in compare(4000, "kernel", program):
        assert tally.is_passed, str(tally)
        assert tally.both > 3600


def test_difference_of_a_component_is_found() -> None:
    scenes = drawn(1, random.Random("difference"))
    wanted = of_kernel(scenes)[0]
    assert difference(wanted, wanted, scenes).max() == 0.0
    for place in range(7):
        found = wanted.copy()
        found[0, place] += 1e-14 * max(1.0, abs(wanted[0, place]))
        assert (difference(found, wanted, scenes) > BOUNDS["binary64"]).sum() == 1


@pytest.mark.parametrize("kind", KINDS)
def test_header_agrees_with_exact_series(kind: str, library: Any) -> None:
    source = random.Random(kind)
    for _ in range(4):
        moments, omega, attitude, time = draw(source, kind)
        found, ended = states(library, "binary64", [[*moments, *omega, *attitude, time]])
        assert ended[0] == OK
        exact_omega, exact_attitude = exact(moments, omega, attitude, time)
        size = max(*map(abs, omega), *(abs(float(x)) for x in exact_omega)) or 1.0
        assert largest_error(found[0, :3], exact_omega) < 2e-14 * size
        assert largest_error(found[0, 3:], exact_attitude) < 2e-15


def test_scale_of_moments_and_omega_does_not_matter(library: Any) -> None:
    scenes = drawn(20, random.Random("scales"))
    found, _ = states(library, "binary64", scenes)
    for moments, omega in ((2.0**-490, 1.0), (2.0**490, 2.0**490), (1.0, 2.0**-490)):
        scaled = scenes.copy()
        scaled[:, :3] *= moments
        scaled[:, 3:6] *= omega
        scaled[:, 10] /= omega
        again, ended = states(library, "binary64", scaled)
        again[:, :3] /= omega
        complete = ended == OK
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
    assert np.array_equal(ended[own] == OK, kernel_ended[own] == 0)
    assert (ended[~finite] != OK).all()
    assert np.isnan(found[ended != OK]).all()
    both = (ended == OK) & (kernel_ended == 0)
    assert both.sum() > 500
    assert difference(found[both], wanted[both], scenes[both]).max() < 1e-9


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [(0, 0.0, INVALID), (1, -1.0, INVALID), (2, np.nan, INVALID), (3, np.inf, INVALID),
     (6, np.nan, INVALID), (10, np.inf, INVALID), (0, 1e-40, RANGE), (10, 1e16, PHASE)],
)  # fmt: skip
def test_status_says_what_is_wrong(place: int, value: float, status: int, library: Any) -> None:
    scene = np.array([[3.0, 2.0, 1.2, 0.3, 1.1, -0.7, 1.0, 0.0, 0.0, 0.0, 2.5]])
    assert states(library, "binary64", scene)[1][0] == OK
    scene[0, place] = value
    found, ended = states(library, "binary64", scene)
    assert ended[0] == status
    assert np.isnan(found).all()


def test_zero_quaternion_and_overflow_are_refused(library: Any) -> None:
    scene = np.array([[3.0, 2.0, 1.2, 0.3, 1.1, -0.7, 0.0, 0.0, 0.0, 0.0, 2.5]])
    assert states(library, "binary64", scene)[1][0] == INVALID
    # The energy of axis 2 takes omega about axis 1, with its small moment, above 1.8e308.
    scene[0, :7] = [1e-3, 0.5, 1.0, 1e307, 1.7e308, 1e307, 1.0]
    times = np.linspace(0.0, 2e-307, 50)
    ended = states(library, "binary64", [[*scene[0, :10], t] for t in times])[1]
    assert set(ended) == {OK, OVERFLOW}


def steps(library: Any, word: str, scene: Any, dt: float, count: int, compensated: bool) -> Any:
    """Return the state after `count` steps, with what was compensated added."""
    moments = np.array(scene[:3], _REAL[word])
    state, rest = np.array(scene[3:10], _REAL[word]), np.zeros(7, _REAL[word])
    function = library.batch_steps if word == "binary64" else library.batchf_steps
    real = ctypes.c_double if word == "binary64" else ctypes.c_float
    given = [ctypes.c_void_p(each.ctypes.data) for each in (moments, state, rest)]
    last = given[2] if compensated else None
    assert function(ctypes.c_int(count), given[0], real(dt), given[1], last) == OK
    return state.astype(float) + rest


@pytest.mark.parametrize("dt", [0.7, 0.25, 0.06, -0.01, 1e-4, 1e-300])
def test_one_step_is_the_closed_form(dt: float, library: Any) -> None:
    scenes = drawn(6, random.Random("steps"))
    speed = np.abs(scenes[:, 3:6]).max(1)
    scenes[:, 10] = dt / np.where(speed > 0.0, speed, 1.0)
    wanted, ended = states(library, "binary64", scenes)
    complete = ended == OK
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


def test_header_is_cplusplus_too(tmp_path: Path) -> None:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler is found")
    source = tmp_path / "user.cc"
    source.write_text('#include "free_rotor.h"\nint main() { return 0; }\n')
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{get_include()}"]
    subprocess.run([compiler, *flags, str(source), "-o", str(tmp_path / "user")], check=True)


def test_processors_with_numbers_of_16_bits_are_accepted(tmp_path: Path) -> None:
    """With GNU's extensions, gcc then has another evaluation method, for these numbers alone."""
    flags = ["-std=gnu11", "-march=sapphirerapids"]
    try:
        compiled(tmp_path / "empty.o", _written(tmp_path, "int empty;\n"), [*flags, "-c"])
    except subprocess.CalledProcessError:
        pytest.skip("the compiler does not know a processor with numbers of 16 bits")
    compiled(tmp_path / "fuzz.o", flags=[*flags, "-c"])


def _written(folder: Path, text: str) -> Path:
    source = folder / "source.c"
    source.write_text(text)
    return source


def test_fast_math_is_refused(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        compiled(tmp_path / "fast", flags=["-ffast-math"])


def test_examples_of_the_guide_run(tmp_path: Path) -> None:
    text = _GUIDE.with_suffix(".md").read_text()
    example, step = re.findall(r"```c\n(.*?)```", text, re.DOTALL)
    (shown,) = re.findall(r"```c\n.*?```\n\n```output\n(.*?)```", text, re.DOTALL)
    printed = output_of([compiled(tmp_path / "example", _written(tmp_path, example))])
    for line, wanted in zip(printed.splitlines(), shown.splitlines(), strict=True):
        found = np.array(line.split(), float) - np.array(wanted.split(), float)
        assert np.abs(found).max() < 3e-12
    compiled(tmp_path / "step.o", _written(tmp_path, step), ["-c"])


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
