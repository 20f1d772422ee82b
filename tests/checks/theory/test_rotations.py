"""Steady rotations, compared with eigenvalues, the right-hand side, and solved motions."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, solve
from pyharness.checks.theory.rotations import SteadyRotation, rates, steady_rotations
from pyharness.checks.theory.rotations_report import growth_of_bodies, polhodes
from pyharness.engine.methods.linearised import jacobians
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array
from tests.conftest import Printed, ResultOf

BODY = (40.0, 30.0, 20.0)
TOP = (40.0, 40.0, 20.0)


def _scene(torque: Triple, moments: Triple = BODY, omega: Triple = (0.0, 1.0, 2.0)) -> Scene:
    return Scene("", omega, moments=moments, torque=TorqueLaw(torque))


SCENES = {
    "none": _scene((0.0, 0.0, 0.0)),
    "largest": _scene((70.0, 0.0, 0.0)),
    "middle": _scene((0.0, -100.0, 0.0)),
    "smallest": _scene((0.0, 0.0, 100.0)),
    "all": case_scene(5),
    "across": _scene((30.0, 100.0, 0.0), TOP),
    "across, one": _scene((0.0, 100.0, 0.0), TOP),
    "across, first": _scene((0.0, 30.0, -100.0), (20.0, 40.0, 40.0)),
    "one coefficient": Scene("", (1.0, 2.0, 3.0), coefficients=(0.5, 0.0, 0.0)),
    "one coefficient, torque": Scene(
        "", (1.0, 2.0, 3.0), coefficients=(0.5, 0.0, 0.0), torque=TorqueLaw((1.0, 0.0, 0.0))
    ),
    "sphere": Scene("", (1.0, 2.0, 3.0), moments=(2.0, 2.0, 2.0)),
    "rest": _scene((0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0)),
    "faint": _scene((1e-200, 2e-200, 1e-200)),
}


def _rotations(scene: Scene, disturbance: float = 1e-3) -> tuple[SteadyRotation, ...]:
    return steady_rotations(scene, disturbance).rotations


def _jacobian(scene: Scene, omega: Triple) -> Array:
    return np.asarray(jacobians(scene, np.array([omega]))[0])


def _disturbed(scene: Scene, omega: Array, times: Any) -> Array:
    x, y, z = omega.tolist()
    return solve(replace(scene, omega=(x, y, z)), times, tolerance=1e-14).omega


@pytest.mark.property
def test_rates_are_the_eigenvalues_of_the_linearised_equations() -> None:
    draws = np.random.default_rng(32)
    for _ in range(300):
        first, second = draws.uniform(-1.0, 1.0, 2)
        coefficients = (first, -(first + second) / (1.0 + first * second), second)
        omega = draws.normal(size=3) * 10.0 ** draws.uniform(-3.0, 3.0, 3)
        if draws.random() < 0.2:
            omega[draws.integers(3)] = 0.0
        x, y, z = omega.tolist()
        scene = Scene("", (x, y, z), coefficients=coefficients)
        found = np.array(rates(scene.euler_coefficients, scene.omega))
        wanted = np.linalg.eigvals(_jacobian(scene, scene.omega))
        size = np.abs(found).max()
        # For a double root the eigenvalues have half the digits.
        for each in found:
            assert np.abs(wanted - each).min() <= 2e-7 * size
        for each in wanted:
            assert np.abs(found - each).min() <= 2e-7 * size
        assert abs(found.sum()) <= 1e-14 * size
        product = 2.0 * math.prod(coefficients) * x * y * z
        assert found.prod() == pytest.approx(product, rel=1e-12, abs=1e-300)
        assert list(found.real) == sorted(found.real, reverse=True)


def test_growth_that_is_slow_beside_the_oscillation_is_not_lost() -> None:
    coefficients = case_scene(4).euler_coefficients
    a, b, c = coefficients
    found = rates(coefficients, (1.0, 1e-10, -1e-10))
    assert found[0] == pytest.approx(2.0 * a * 1e-20, rel=1e-12, abs=0.0)
    assert found[1] == pytest.approx(1j * math.sqrt(-b * c), rel=1e-12, abs=0.0)
    found = rates(coefficients, (1.0, 1e-10, 1e-10))
    assert found[0].real == pytest.approx(a * 1e-20, rel=1e-12, abs=0.0)
    assert found[2].real == pytest.approx(-2.0 * a * 1e-20, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("name", SCENES)
def test_steady_rotations_are_zeros_of_the_right_hand_side(name: str) -> None:
    scene = SCENES[name]
    found = _rotations(scene)
    assert found
    rate = scene.right_hand_side()
    for each in found:
        size = max(map(abs, each.omega)) ** 2 + max(map(abs, scene.normalized_torque(0.0)))
        assert max(map(abs, rate(0.0, each.omega))) <= 1e-15 * size
        assert each.stable <= (each.rates[0].real <= 0.0)
    assert len({each.omega for each in found}) == len(found)


@pytest.mark.property
def test_three_torques_hold_two_rotations_or_none_and_never_a_stable_one() -> None:
    draws = np.random.default_rng(5)
    counts = []
    for _ in range(200):
        x, y, z = draws.uniform(1.0, 2.0, 3).tolist()
        torque = draws.normal(size=3).tolist()
        scene = _scene((torque[0], torque[1], torque[2]), (x, y, z))
        found = _rotations(scene)
        signed = math.prod(scene.euler_coefficients) * math.prod(scene.normalized_torque(0.0))
        assert len(found) == (2 if signed < 0.0 else 0)
        counts.append(len(found))
        for each in found:
            assert not each.stable
            assert each.rates[0].real > 0.0
            assert each.doubling_time is not None
        if found:
            assert found[0].omega == tuple(-w for w in found[1].omega)
    assert 60 <= counts.count(0) <= 140


@pytest.mark.parametrize(("scene", "words"), [
    (case_scene(1), "A = 0, so that nothing holds the torque about axis 1"),
    (case_scene(6), "ABC M1 M2 M3 > 0"),
    (_scene((1.0, 2.0, 0.0)), "about axes 1 and 2 turns the body about axis 3"),
    (_scene((0.0, 0.0, 2.0), TOP), "C = 0"),
    (_scene((1.0, 2.0, 2.0), TOP), "C = 0"),
])  # fmt: skip
def test_scene_without_steady_rotations_says_why(scene: Scene, words: str) -> None:
    found = steady_rotations(scene, 1e-3)
    assert found.rotations == ()
    assert found.told.startswith("none: ")
    assert words in found.told


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("coefficients", "omega"), [((3e-173, 1.0, -1e-271), 3e-192), ((1e-7, 2.5e-92, -1.5e274), 7e8)]
)
def test_end_of_the_linear_picture_beyond_binary64_is_not_told(
    coefficients: Triple, omega: float
) -> None:
    found = _rotations(Scene("", (0.0, omega, 0.0), coefficients=coefficients))
    assert any(each.rates[0].real > 0.0 and each.linear_until is None for each in found)


_MOVING = ("none", "largest", "middle", "smallest", "all", "across", "across, first")


@pytest.mark.parametrize("name", _MOVING)
def test_stability_is_that_of_motions_that_are_solved(name: str) -> None:
    """Unstable rotations grow with Re Q, or with t where Q is 0; stable ones stay."""
    scene = SCENES[name]
    for each in _rotations(scene):
        spin = math.hypot(*each.omega)
        small = 1e-7 * spin * np.array([0.6, 0.48, 0.64])
        rate = each.rates[0].real
        if rate:
            times = 6.0 / rate + np.array([0.0, each.period or 1.0 / rate])
        else:
            times = np.linspace(0.1, 400.0, 800) * (each.period or 1.0 / spin)
        away = _disturbed(scene, each.omega + small, times) - each.omega
        sizes = np.linalg.norm(away, axis=1) / np.linalg.norm(small)
        if rate:
            measured = math.log(sizes[1] / sizes[0]) / (times[1] - times[0])
            assert measured == pytest.approx(rate, rel=2e-3), each.place
        else:
            assert (sizes.max() < 60.0) == each.stable, each.place


def test_hyperbola_is_stable_to_its_margin() -> None:
    """The middle axis has a stable hyperbola; the others' is stable on one side of its margin."""
    assert all(each.stable for each in _rotations(SCENES["middle"]))
    for name in ("largest", "smallest"):
        found = _rotations(SCENES[name])
        (place,) = (k for k, each in enumerate(found) if each.place == "its margin")
        assert found[place].rates == (0j, 0j, 0j)
        sides = (
            {each.stable for each in found[:place]},
            {each.stable for each in found[place + 1 :]},
        )
        assert sides in (({True}, {False}), ({False}, {True}))
        assert not found[place].stable


def test_top_drifts_away_from_an_axis_across_its_own() -> None:
    first, second, own = _rotations(case_scene(2))
    for each in (first, second):
        assert each.rates == (0j, 0j, 0j)
        assert not each.stable
        assert each.doubling_time is each.period is each.flip_interval is each.linear_until is None
    assert own.stable
    assert own.linear_until == math.inf


def test_where_nothing_turns_about_a_stable_axis_no_time_is_told() -> None:
    # The spin itself drifts with the square of the perturbation, so that no phase can be wrong.
    first, *_ = _rotations(SCENES["one coefficient"])
    assert first.stable
    assert first.rates == (0j, 0j, 0j)
    assert first.linear_until is None


def test_sphere_and_rest_are_left_as_they_are() -> None:
    assert steady_rotations(SCENES["sphere"], 1e-3).told.endswith("every rotation is steady")
    for each in _rotations(SCENES["sphere"]):
        assert each.stable
        assert each.linear_until == math.inf
    (rest,) = _rotations(SCENES["rest"])
    assert rest.place == "rest"
    assert rest.stable
    assert rest.linear_until is None


@pytest.mark.parametrize(
    ("name", "place"), [("none", 1), ("smallest", 0), ("smallest", 1), ("largest", -1), ("all", 0)]
)
def test_linear_picture_is_a_tenth_off_when_it_says(name: str, place: int) -> None:
    scene = SCENES[name]
    each: Any = _rotations(scene, 1e-4)[place]
    values, vectors = np.linalg.eig(_jacobian(scene, each.omega))
    grows = vectors[:, np.argmax(values.real)].real
    small = 1e-4 * math.hypot(*each.omega) * grows
    (away,) = _disturbed(scene, each.omega + small, [each.linear_until]) - each.omega
    linear = small * math.exp(each.rates[0].real * each.linear_until)
    off = np.linalg.norm(away - linear) / np.linalg.norm(away)
    assert 0.08 <= off <= 0.12
    assert _rotations(scene, 0.9)[place].linear_until == 0.0


def test_linear_picture_without_terms_of_second_order_never_ends() -> None:
    # With A = 0 the spin about the first axis is constant, and the equations are linear.
    scene = Scene("", (1.0, 0.0, 0.0), coefficients=(0.0, 1.0, 1.0))
    first = next(each for each in _rotations(scene) if each.omega == (1.0, 0.0, 0.0))
    assert first.rates[0].real == pytest.approx(1.0)
    assert first.linear_until == math.inf


def test_linear_picture_of_what_grows_in_waves_ends_about_when_it_says() -> None:
    scene = SCENES["all"]
    each: Any = _rotations(scene, 1e-4)[1]
    values, vectors = np.linalg.eig(_jacobian(scene, each.omega))
    chosen = np.argmax(values.imag)
    offs = []
    for phase in np.linspace(0.0, 2.0 * np.pi, 12):
        grows = vectors[:, chosen] * np.exp(1j * phase)
        size = 1e-4 * math.hypot(*each.omega)
        (away,) = (
            _disturbed(scene, each.omega + size * grows.real, [each.linear_until]) - each.omega
        )
        linear = size * (grows * np.exp(values[chosen] * each.linear_until)).real
        # The size of an oscillation is its largest over a whole turn.
        offs.append(np.linalg.norm(away - linear) / (size * math.exp(
            each.rates[0].real * each.linear_until)))  # fmt: skip
    assert 0.05 <= max(offs) <= 0.12


@pytest.mark.parametrize(("axis", "toward"), [(0, 2), (2, 0)])
def test_phase_about_a_stable_axis_is_a_tenth_off_when_it_says(axis: int, toward: int) -> None:
    scene, tilt = SCENES["none"], 0.02
    each: Any = _rotations(scene, tilt)[axis]
    spin = each.omega[axis]
    # The perturbation is towards the axis of the smaller coefficient.
    sizes = np.abs(scene.euler_coefficients)
    toward = min({0, 1, 2} - {axis}, key=lambda k: sizes[k])
    start = np.array(each.omega)
    start[toward] = tilt * spin
    (other,) = {0, 1, 2} - {axis, toward}
    rate = each.rates[0].imag
    (omega,) = _disturbed(scene, start, [each.linear_until])
    phase = math.atan2(
        omega[other] / math.sqrt(sizes[other]), omega[toward] / math.sqrt(sizes[toward])
    )
    turned = (abs(phase) - rate * each.linear_until) % (2.0 * np.pi)
    back = (-abs(phase) - rate * each.linear_until) % (2.0 * np.pi)
    assert min(min(x, 2.0 * np.pi - x) for x in (turned, back)) == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("moments", [BODY, (2.0, 3.5, 4.1), (3.0, 2.0, 2.7)])
@pytest.mark.parametrize("tilt", [0.3, 1e-2, 1e-5])
def test_flips_come_when_they_are_said_to(moments: Triple, tilt: float) -> None:
    scene = _scene((0.0, 0.0, 0.0), moments)
    middle = int(np.argsort(moments)[1])
    each = _rotations(scene, tilt)[middle]
    assert [other.flip_interval is None for other in _rotations(scene)].count(False) == 1
    interval: Any = each.flip_interval
    sizes = np.abs(scene.euler_coefficients)
    toward, other = sorted({0, 1, 2} - {middle}, key=lambda k: sizes[k])
    start = np.array(each.omega)
    spin = start[middle]
    start[toward] = tilt * spin
    (flipped,) = _disturbed(scene, start, [interval])
    wanted = start.copy()
    wanted[middle] = -spin
    # Near the separatrix, the rest of the small component has the size of rounding times 1/k'.
    assert np.abs(flipped - wanted).max() <= 1e-13 * spin / tilt
    # With a perturbation towards the other axis, the flip is not yet complete.
    start[[toward, other]] = start[[other, toward]]
    (late,) = _disturbed(scene, start, [interval])
    assert late[middle] > -spin * (1.0 - 1e-4 * tilt**2)
    if tilt <= 1e-2:
        complement = tilt / math.sqrt(tilt**2 + sizes[toward] / sizes[middle])
        rate = math.sqrt(math.prod(sizes) * (tilt**2 / sizes[toward] + 1.0 / sizes[middle])) * spin
        near = 2.0 / rate * math.log(4.0 / complement)
        assert interval == pytest.approx(near, rel=0.3 * complement**2)


def test_bodies_without_a_middle_axis_never_flip() -> None:
    for each in _rotations(Scene("", (0.0, 1.0, 1.0), coefficients=(0.5, 0.25, 0.3))):
        assert not each.stable
        assert each.flip_interval is None


@pytest.mark.parametrize("moments", [BODY, TOP, (20.0, 40.0, 40.0), (3.0, 4.0, 2.0)])
def test_polhodes_keep_momentum_and_energy(moments: Triple) -> None:
    curves = list(polhodes(moments))
    energies = []
    for name, curve in curves:
        np.testing.assert_allclose((curve**2).sum(axis=1), 1.0, rtol=1e-14)
        energy = (curve**2 / moments).sum(axis=1)
        np.testing.assert_allclose(energy, energy[0], rtol=1e-14)
        energies.append((name, energy[0]))
    middle = 1.0 / sorted(moments)[1]
    for name, energy in energies:
        assert (name == "separatrix") == (energy == pytest.approx(middle, rel=1e-12))
    assert not list(polhodes((2.0, 2.0, 2.0)))


def test_growth_of_bodies_is_that_of_their_middle_axes() -> None:
    draws = np.random.default_rng(4)
    for _ in range(50):
        x, y = draws.uniform(1.0, 2.0, 2).tolist()
        scene = _scene((0.0, 0.0, 0.0), (x, y, draws.uniform(abs(x - y), x + y)), (0.0, 0.0, 1.0))
        a, _, c = scene.euler_coefficients
        wanted = max(each.rates[0].real for each in _rotations(scene))
        assert float(growth_of_bodies(np.array(a), np.array(-c))) == pytest.approx(wanted)
    assert np.isfinite(growth_of_bodies(np.array([1.0, -1.0]), np.array([1.0, -1.0]))).all()


def test_json_and_csv_tell_what_was_found(printed: Printed) -> None:
    record = json.loads(printed("rotations --case 5 --format json"), parse_constant=pytest.fail)
    assert record["schema"] == 1
    found = _rotations(case_scene(5))
    assert [tuple(each["omega"]) for each in record["rotations"]] == [e.omega for e in found]
    for told, each in zip(record["rotations"], found, strict=True):
        assert [complex(*rate) for rate in told["rates"]] == list(each.rates)
        for name in ("stable", "doubling_time", "period", "linear_until", "flip_interval"):
            assert told[name] == getattr(each, name)
    rows = list(csv.DictReader(printed("rotations --case 5 --format csv").splitlines()))
    for row, each in zip(rows, found, strict=True):
        assert float(row["omega2"]) == each.omega[1]
        assert complex(float(row["rate2_re"]), float(row["rate2_im"])) == each.rates[1]
        assert float(row["linear_until"]) == each.linear_until
    record = json.loads(printed("rotations --case 2 --format json"), parse_constant=pytest.fail)
    assert [each["linear_until"] for each in record["rotations"]] == [None] * 3
    record = json.loads(printed("rotations --case 6 --format json"))
    assert record["rotations"] == []
    assert record["told"].startswith("none: ")
    assert "-0.0" not in printed("rotations --case 4 --format json")


@pytest.mark.parametrize("name", SCENES)
def test_table_fits_the_terminal(name: str, printed: Printed, tmp_path: Path) -> None:
    from pyharness.model.scene_file import scene_text

    path = tmp_path / "scene.toml"
    path.write_text(scene_text(SCENES[name]))
    lines = printed(f"rotations --scene {path} --disturbance 1e-9").splitlines()
    assert max(map(len, lines)) <= 100
    (head,) = [number for number, line in enumerate(lines) if line.startswith("rotation ")]
    stable = [" yes " in line for line in lines[head + 1 :]][: len(_rotations(SCENES[name]))]
    assert stable == [each.stable for each in _rotations(SCENES[name])]
    markdown = printed(f"rotations --scene {path} --format markdown").splitlines()
    assert len(markdown) == 2 + len(_rotations(SCENES[name]))


def test_rates_are_said_in_few_words(printed: Printed) -> None:
    for case, words in ((4, "0, +-3.553"), (4, "0, +-4.103i"), (5, "1.158, -0.5788+-2.289i")):
        assert words in printed(f"rotations --case {case}")


def test_disturbance_is_what_the_times_hang_on(printed: Printed) -> None:
    for disturbance in (1e-3, 1e-6):
        text = printed(f"rotations --case 4 --disturbance {disturbance} --format json")
        (told,) = {each["flip_interval"] for each in json.loads(text)["rotations"]} - {None}
        assert told == _rotations(case_scene(4), disturbance)[1].flip_interval


@pytest.mark.campaign
@pytest.mark.parametrize("case", [1, 4, 6])
def test_picture_has_its_numbers(case: int, printed: Printed, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "x.svg"
    printed(f"rotations --case {case} --plot {path}")
    if case == 1:
        again = tmp_path / "y.svg"
        printed(f"rotations --case {case} --plot {again}")
        assert path.read_bytes() == again.read_bytes()
    rows = list(csv.DictReader(path.with_suffix(".csv").read_text().splitlines()))
    cases = {row["curve"]: row for row in rows if row["panel"] == "case"}
    assert sorted(cases) == list("123457")
    a, _, c = case_scene(4).euler_coefficients
    assert (float(cases["4"]["x"]), float(cases["4"]["y"])) == (a, -c)
    assert any(row["curve"] == "separatrix" for row in rows) == (case != 1)


def test_picture_of_no_body_is_refused(result_of: ResultOf, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text("[body]\ncoefficients = [0.5, -0.4, 0.1]\n[initial]\nomega = [0, 0, 1]\n")
    found = result_of(["rotations", "--scene", str(path), "--plot", str(tmp_path / "x.png")], 2)
    assert (found.out, "--plot" in found.err) == ("", True)
