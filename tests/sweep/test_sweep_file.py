"""Sweep files: their meaning."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pyharness import InputError, case_scene
from pyharness.sweep.axes import axis_of
from pyharness.sweep.batches import batches
from pyharness.sweep.sweep import points, spread
from pyharness.sweep.sweep_file import read_sweep
from tests.sweep.sweeps import BASE, PROGRAM, SQUARE, TILT, axis, every, text, written


def test_chunks_cover_the_grid_once_and_hold_one_listing(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, PROGRAM))
    assert sweep.shape == (2, 12, 2)
    assert sweep.chunk_shape == (1, 10, 2)
    count = np.zeros(sweep.shape, dtype=int)
    for chunk in range(sweep.n_chunks):
        count[sweep.box(chunk)] += 1
        (held,) = {batch.listing for _, batch in batches(sweep, points(sweep.box(chunk)))}
        assert held is not None
    assert (count == 1).all()


READINGS = """
reductions = ["status"]
[scene]
case = 3
[[axis]]
field = "program"
dimension = "reading"
values = ["four-term", "runge-kutta"]
[[axis]]
field = "reading"
dimension = "reading"
values = ["adopted", "do-variable"]
"""


def test_words_along_one_dimension_go_together(tmp_path: Path) -> None:
    """The four-term program has no DO variable, so a grid of the two dimensions is refused."""
    sweep = read_sweep(written(tmp_path, READINGS))
    listings = [batch.listing for _, batch in batches(sweep, every(sweep))]
    found = [(each.program, *each.readings) for each in listings if each]
    assert found == [("four-term",), ("runge-kutta", "do-variable")]


def test_height_and_longitude_go_over_the_sphere(tmp_path: Path) -> None:
    axes = (
        axis("height", [-1.0, 0.6]), axis("longitude", [0.0, np.pi / 2.0]),
        axis("omega.magnitude", [10.0]),
    )  # fmt: skip
    sweep = read_sweep(written(tmp_path, text(*axes)))
    ((_, batch),) = batches(sweep, every(sweep))
    wanted = [[0.0, 0.0, -10.0], [0.0, 0.0, -10.0], [8.0, 0.0, 6.0], [0.0, 8.0, 6.0]]
    assert np.abs(batch.omega0 - wanted).max() < 1e-14
    alone = read_sweep(written(tmp_path, text(axes[1], axes[2])))
    ((_, batch),) = batches(alone, every(alone))
    assert np.abs(batch.omega0 - [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]).max() < 1e-14


def test_sample_reaches_the_ends_of_any_grid(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, PROGRAM))
    where = spread(sweep, 7)
    assert [int(each[0]) for each in where] == [0, 0, 0]
    assert [int(each[-1]) for each in where] == [n - 1 for n in sweep.shape]
    assert len(spread(sweep, 1000)[0]) == sweep.n_scenes


@pytest.mark.parametrize("how", ["uniform", "log-uniform", "normal", "sphere"])
def test_draws_are_what_they_are_called(how: str) -> None:
    table = {"field": "tilt", "draw": how, "count": 20_000}
    more = {"normal": {"mean": 2.0, "deviation": 0.5}, "sphere": {}}.get(how, {"from": 1, "to": 4})
    values, again, other = (
        axis_of({**table, **more, "seed": seed}, n).coordinates()
        for seed, n in ((3, 1), (3, 2), (4, 1))
    )
    assert (values == again).all()
    assert (values != other).any()
    expected = {
        "uniform": 2.5, "log-uniform": 3.0 / np.log(4.0), "normal": 2.0, "sphere": np.pi / 2.0,
    }  # fmt: skip
    assert abs(values.mean() - expected[how]) < 0.05


def test_every_body_of_the_square_is_real_and_as_asked(tmp_path: Path) -> None:
    other = SQUARE.replace("square.1", "square.2").replace("0.2", "0.0")
    sweep = read_sweep(written(tmp_path, text(SQUARE, other, TILT)))
    where = points(sweep.box(0))
    ((_, batch),) = batches(sweep, where)
    low, middle, high = batch.arrays["moments"].T
    assert (low <= middle).all()
    assert (middle <= high).all()
    assert (high <= low + middle + 1e-12).all()
    assert np.allclose(high, 3.0)
    tilts = sweep.axes[2].coordinates()[where[2]]
    found = np.arccos(batch.omega0[:, 1] / np.linalg.norm(batch.omega0, axis=1))
    assert np.allclose(found, tilts, atol=1e-7)


@pytest.mark.parametrize("size", [1e-170, 1.0, 1e200])
def test_directions_do_not_depend_on_the_size_of_omega(size: float, tmp_path: Path) -> None:
    start = np.array([0.6, 0.8, 0.0]) * size
    scene = BASE.replace("[0.0, 1.0, 0.0]", str(start.tolist()))
    for field, values, wanted in (
        ("tilt", [0.0, np.pi / 2.0], [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
        ("omega.magnitude", [size, 2.0 * size], [[0.6, 0.8, 0.0], [1.2, 1.6, 0.0]]),
    ):
        sweep = read_sweep(written(tmp_path, text(axis(field, values), scene=scene)))
        ((_, batch),) = batches(sweep, every(sweep))
        assert np.abs(batch.omega0 / size - wanted).max() < 1e-15


def test_fields_reach_the_scenes(tmp_path: Path) -> None:
    axes = (
        axis("body.ratio.1", [0.5, 0.25]), axis("torque.constant.2", [0.0, 3.0]),
        axis("omega.magnitude", [2.0]), axis("t_end", [1.0, -2.0]), axis("tolerance", [1e-6, 1e-9]),
    )  # fmt: skip
    sweep = read_sweep(written(tmp_path, text(*axes)))
    found = list(batches(sweep, points(sweep.box(0))))
    assert [batch.solver.tolerance for _, batch in found] == [1e-9, 1e-6]
    batch = found[0][1]
    assert len(batch.omega0) == 8
    moments = {tuple(row) for row in batch.arrays["moments"].tolist()}
    assert moments == {(0.75, 2, 3), (1.5, 2, 3)}
    assert sorted(set(batch.arrays["torque_constant"][:, 1])) == [0.0, 3.0]
    assert (batch.omega0 == [0.0, 2.0, 0.0]).all()
    assert sorted(set(batch.t_end)) == [-2.0, 1.0]


def test_scene_may_be_a_file_beside_and_is_part_of_the_fingerprint(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(BASE.replace("scene.", ""))
    path = written(tmp_path, text(TILT, scene='[scene]\nfile = "base.toml"'))
    before = read_sweep(path)
    assert before.scene.moments == (1.0, 2.0, 3.0)
    (tmp_path / "base.toml").write_text(BASE.replace("scene.", "").replace("3.0", "2.5"))
    assert read_sweep(path).fingerprint != before.fingerprint
    case = read_sweep(written(tmp_path, text(TILT, scene="[scene]\ncase = 5")))
    assert case.scene == case_scene(5)


def test_sweep_of_the_documents_is_one() -> None:
    sweep = read_sweep(Path(__file__).parent.parent.parent / "docs/tumbling.toml")
    assert sweep.n_scenes == 2000
    assert sweep.n_chunks == 1


@pytest.mark.parametrize("more", ["", "draw = 'uniform'\nseed = 1\n"])
@pytest.mark.parametrize("ends", [(-1.7e308, 1.7e308), (1.7e308, -1.7e308)])
def test_axis_may_span_the_whole_range_of_numbers(ends: tuple[float, float], more: str) -> None:
    table = f"field = 'omega.1'\nfrom = {ends[0]}\nto = {ends[1]}\ncount = 5\n{more}"
    values = axis_of(tomllib.loads(table), 1).coordinates()
    assert np.abs(values).max() <= 1.7e308
    if not more:
        assert (values[0], values[-1]) == ends
        even = np.array([ends[0], 0.5 * ends[0], 0.0, 0.5 * ends[1], ends[1]])
        np.testing.assert_allclose(values, even, rtol=1e-15)
    assert len(set(values.tolist())) == 5


def test_drawn_value_never_leaves_the_ends_of_its_axis() -> None:
    """The logarithm of the largest number is rounded, and its exponential would overflow."""
    table = (
        "field = 'omega.1'\ndraw = 'log-uniform'\nfrom = 1.7976931348623157e308\n"
        "to = 1.7976931348623157e308\ncount = 9\nseed = 1"
    )
    assert set(axis_of(tomllib.loads(table), 1).coordinates().tolist()) == {1.7976931348623157e308}


@pytest.mark.parametrize(("field", "value"), [("method", "auto"), ("tilt", 1.0)])
def test_cached_values_can_not_be_changed(field: str, value: object) -> None:
    with pytest.raises(ValueError, match="read-only"):
        axis_of({"field": field, "values": [value]}, 1).coordinates()[0] = value


def test_two_axes_of_one_seed_have_numbers_of_their_own() -> None:
    table = {"draw": "uniform", "from": 0.0, "to": 1.0, "count": 2000, "seed": 3}
    first, second = (
        axis_of({**table, "field": f"omega.{axis}"}, 1).coordinates() for axis in (1, 2)
    )
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.1


CASE = "[scene]\ncase = 3\n"
OMEGA = axis("omega.1", [1.0])
PLACED = '[[axis]]\nfield = "omega.1"\n'
DRAWN = PLACED + "draw = 'normal'\nmean = 0.0\ncount = 2\n"
# The content of a sweep file, and a part of the message.
REFUSED = {
    f"name = 3\n{CASE}{OMEGA}": "name is a whole number; it must be text",
    CASE + "".join(axis(f"constants.{n}", [1.0]) for n in range(40)): "axis: 40 of them",
    f"reductions = []\n{CASE}{OMEGA}": "reductions is empty; allowed: a list, not empty",
    f"reductions = 3\n{CASE}{OMEGA}": "reductions is a whole number; allowed: a list",
    f"{CASE}{axis('steps', [])}": "values is empty; allowed: a list, not empty",
    f"{CASE}{PLACED}values = 3\n": "values is a whole number; allowed: a list, not empty",
    f"scene = 3\n{OMEGA}": "scene is a whole number; it must be a table [scene]",
    f"[scene]\ncase = 3\nfile = 'a.toml'\n{OMEGA}": "[scene]: allowed: case, or file, or",
    f"[scene]\nfile = 3\n{OMEGA}": "[scene] file is a whole number; it must be text",
    f"solve = 3\n{CASE}{OMEGA}": "solve is a whole number; it must be a table [solve]",
    f"{CASE}[solve]\nmethod = 'rk4'\n{axis('method', ['rk4'])}": "[solve] method: it is given here",
    f"{CASE}[solve]\nt_end = 1\n{axis('t_end', [2.0])}": "[solve] t_end: it is given here",
    f"{CASE}[solve]\nmethod = 'rk4'\n{axis('tolerance', [0.1])}": "rk4 has a fixed step and no",
    f"{CASE}{axis('steps', [2.5])}": "(steps): 2.5; allowed: whole numbers",
    f"{CASE}{axis('steps', [1e12])}": "(steps): 1e+12; allowed: 1 to what fits in",
    f"{CASE}[solve]\nmethod = 3\n{OMEGA}": "[solve] method is a whole number; it must be text",
    f"{CASE}[solve]\nprogram = 'two-term'\nlipschitz = -1\n{OMEGA}": "[solve] lipschitz is -1",
    f"reductions = [3]\n{CASE}{OMEGA}": "reductions: allowed: names, and tables",
    f"reductions = [{{name = 'end', of = 3}}]\n{CASE}{OMEGA}": "unknown parameter",
    f"reductions = [{{name = 'end', as = '?'}}]\n{CASE}{OMEGA}": "reductions: end as: allowed",
    f"{CASE}{OMEGA}{axis('omega.2', [1, 2])}dimension = 'omega.1'\n": "omega.1 has 1 values",
    f"reductions = [{{name = 'growth', offset = 1e-13}}]\n{CASE}{OMEGA}": "offset 1e-13; allowed",
    CASE + OMEGA + OMEGA: "omega.1: two axes vary this field; give one axis",
    f"{CASE}{axis('lipschitz', [1.0])}": "lipschitz has no meaning without a program",
    f"axis = 3\n{CASE}": "axis is missing; give at least one table [[axis]]",
    f"axis = [3]\n{CASE}": "[[axis]] 1 is a whole number; it must be a table [[axis]]",
    f"{CASE}{OMEGA}dimension = 3\n": "(omega.1): dimension must be text",
    f"{CASE}{OMEGA}dimension = '.a'\n": "(omega.1): dimension '.a'; allowed: a name without '/'",
    f'{CASE}[[axis]]\nfield = "method"\n': "(method): values is missing; give a list of names",
    f"{CASE}{axis('method', [3])}": "(method): a whole number where a name belongs",
    f"{CASE}{axis('method', ['rk4', 'rk4'])}": "(method): a name is given twice",
    f"{CASE}{DRAWN}deviation = -1.0\nseed = 1\n": "(omega.1): deviation -1; allowed",
    f"{CASE}{DRAWN}deviation = 1.0\nseed = -1\n": "(omega.1): seed is out of range; allowed",
    f"{CASE}[[axis]]\nfield = 'height'\ndraw = 'sphere'\ncount = 50\nseed = 1\n": "(height): ",
    f"{CASE}{DRAWN}deviation = 1.0\n": "(omega.1): seed is missing; give a whole number from 0",
}  # fmt: skip


@pytest.mark.parametrize(("content", "message"), REFUSED.items(), ids=REFUSED.values())
def test_what_a_sweep_file_may_not_say(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(InputError) as refused:
        read_sweep(written(tmp_path, content))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
