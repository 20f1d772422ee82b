"""Attitude ephemeris messages of CCSDS, written and read."""

import re
from pathlib import Path
from random import Random

import numpy as np
import pytest

from pyharness import InputError, Scene, Trajectory, solve
from pyharness.interchange import read_aem, write_aem
from pyharness.interchange.epochs import epoch_text, later, read_epoch, seconds_between
from pyharness.model.attitude import angle_between, matrices

SCENE = Scene("wing nut", moments=(1.0, 2.0, 3.0), omega=(1e-3, 2.0, 1e-3))
EPOCH = "2026-01-31T23:59:58.25"

HEAD = """\
CCSDS_AEM_VERS = {version}
CREATION_DATE = 2026-01-31T00:00:00
ORIGINATOR = TEST
META_START
OBJECT_NAME = BRICK
OBJECT_ID = UNKNOWN
REF_FRAME_A = {a}
REF_FRAME_B = {b}
TIME_SYSTEM = TAI
START_TIME = 2026-01-31T00:00:00
STOP_TIME = 2026-01-31T00:00:02
{more}
META_STOP
"""


@pytest.fixture(scope="module")
def found() -> Trajectory:
    return solve(SCENE, [-3.0, 0.1, 0.3, 20.0], attitude=True, dense_output=True)


def written(path: Path, kind: str, rows: str, more: str = "", **values: str) -> Path:
    given = {"version": "2.0", "a": "EME2000", "b": "SC_BODY_1"} | values
    more = f"ATTITUDE_TYPE = {kind}" + (f"\n{more}" if more else "")
    path.write_text(HEAD.format(**given, more=more) + rows)
    return path


def test_what_is_written_is_read(tmp_path: Path, found: Trajectory) -> None:
    path = tmp_path / "a.aem"
    write_aem(found, path, epoch=EPOCH, metadata={"OBJECT_NAME": "NUT", "CENTER_NAME": "EARTH"})
    (segment,) = read_aem(path)
    assert segment.metadata["OBJECT_NAME"] == "NUT"
    assert segment.epoch == "2026-01-31T23:59:55.25"
    assert segment.time.tolist() == [0.0, 3.1, 3.3, 23.0]
    assert segment.omega is not None
    assert found.attitude is not None
    np.testing.assert_allclose(segment.attitude, found.attitude, rtol=0, atol=5e-16)
    np.testing.assert_allclose(segment.omega, found.omega, rtol=1e-15, atol=1e-18)
    lines = path.read_text().splitlines()
    # Seconds are exact decimals, also over midnight.
    assert [line.split()[0] for line in lines[lines.index("DATA_START") + 1 : -1]] == [
        "2026-01-31T23:59:55.25", "2026-01-31T23:59:58.35", "2026-01-31T23:59:58.55",
        "2026-02-01T00:00:18.25",
    ]  # fmt: skip
    assert "INTERPOLATION_METHOD = HERMITE" not in lines
    assert max(map(len, lines)) <= 254
    mantissas = re.findall(r"(\d\.\d+)e", path.read_text())
    assert {len(each) - 1 for each in mantissas} == {16}


def test_the_quaternion_is_that_of_the_standard(tmp_path: Path) -> None:
    """Annex F2.2: frame B results from A by a rotation of 90 degrees about the axis Z."""
    rows = (
        "DATA_START\n2026-01-31T00:00:00 0 0 0.70710678118654752 0.70710678118654752\nDATA_STOP\n"
    )
    (segment,) = read_aem(written(tmp_path / "a.aem", "QUATERNION", rows))
    # From A to B, the inverse of the matrix from body to space.
    matrix = matrices(segment.attitude)[0].T
    np.testing.assert_allclose(matrix, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    scene = Scene("turned", moments=(1.0, 1.0, 1.0), omega=(0.0, 0.0, np.pi / 2.0))
    found = solve(scene, [0.0, 1.0], attitude=True)
    path = tmp_path / "b.aem"
    write_aem(found, path, epoch=EPOCH)
    row = path.read_text().splitlines()[-2].split()[1:]
    np.testing.assert_allclose([float(each) for each in row], [0, 0, 0.5**0.5, 0.5**0.5, 0, 0, 90])


def test_the_recommended_interpolation_keeps_the_tolerance(
    tmp_path: Path, found: Trajectory
) -> None:
    from pyharness.interchange.knots import hermite

    assert found.sol is not None
    path = tmp_path / "a.aem"
    sizes = []
    for tolerance in (1e-3, 1e-6, 1e-9):
        write_aem(found, path, epoch=EPOCH, tolerance=tolerance)
        (segment,) = read_aem(path)
        assert segment.metadata["INTERPOLATION_DEGREE"] == "7"
        assert segment.omega is not None
        q, w = segment.attitude, segment.omega
        vector = q[:, :1] * w + np.cross(q[:, 1:], w)
        rates = np.column_stack([-(q[:, 1:] * w).sum(axis=1), vector]) / 2.0
        at = np.random.default_rng(int(-np.log10(tolerance))).uniform(0.0, 23.0, 500)
        low = np.searchsorted(segment.time, at, side="right") - 1
        window = np.clip(low - 1, 0, len(q) - 4)[:, None] + np.arange(4)
        seen = hermite(segment.time[window], q[window], rates[window], at[:, None])[:, 0]
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        exact = found.sol(np.clip(at - 3.0, -3.0, 20.0))[3:].T
        error = angle_between(seen, exact).max()
        assert tolerance / 1000.0 < error <= tolerance
        sizes.append(len(q))
    assert sizes == sorted(sizes)
    assert sizes[2] < 600


def test_frames_directions_and_derivatives_are_understood(tmp_path: Path) -> None:
    source = np.random.default_rng(2611)
    path = tmp_path / "a.aem"
    for _ in range(20):
        q = source.normal(size=4)
        q /= np.linalg.norm(q)
        omega = source.normal(size=3)
        body_to_space = matrices(q[None])[0]
        w, v = q[0], q[1:]
        rate = np.array([-v @ omega, *(w * omega + np.cross(v, omega))]) / 2.0
        last, conjugate = [*v, w], [*-v, w]
        degrees = np.degrees(omega)
        rate_last, rate_back = [*rate[1:], rate[0]], [*-rate[1:], rate[0]]
        old = {"version": "1.0"}
        turned = {"a": "SC_BODY_1", "b": "EME2000"}
        cases: tuple[tuple[str, list[float], str, dict[str, str]], ...] = (
            ("QUATERNION/ANGVEL", [*last, *degrees], "ANGVEL_FRAME = SC_BODY_1", {}),
            ("QUATERNION/ANGVEL", [*last, *body_to_space @ degrees], "ANGVEL_FRAME = EME2000", {}),
            ("QUATERNION/DERIVATIVE", [*last, *rate_last], "", {}),
            # From the body to space, with the angular velocity of space against the body
            ("QUATERNION/ANGVEL", [*conjugate, *-degrees], "ANGVEL_FRAME = SC_BODY_1", turned),
            (
                "QUATERNION/ANGVEL",
                [*conjugate, *-body_to_space @ degrees],
                "ANGVEL_FRAME = EME2000",
                turned,
            ),
            ("QUATERNION/DERIVATIVE", [*conjugate, *rate_back], "", turned),
            ("QUATERNION", last, "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST", old),
            ("QUATERNION", [w, *v], "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = FIRST", old),
            ("QUATERNION", conjugate, "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = LAST", old),
            ("QUATERNION/DERIVATIVE", [*conjugate, *rate_back], "ATTITUDE_DIR = B2A", old),
            ("QUATERNION", last, "ATTITUDE_DIR = B2A", old | turned),
        )
        for kind, row, more, values in cases:
            numbers = " ".join(map(repr, map(float, row)))
            written(path, kind, f"2026-01-31T00:00:00 {numbers}\n", more, **values)
            (segment,) = read_aem(path)
            np.testing.assert_allclose(segment.attitude[0], q, atol=1e-15, err_msg=more)
            if kind == "QUATERNION":
                assert segment.omega is None
            else:
                assert segment.omega is not None
                np.testing.assert_allclose(segment.omega[0], omega, atol=1e-14, err_msg=more)


def test_segments_and_comments(tmp_path: Path) -> None:
    path = tmp_path / "a.aem"
    row = "2026-031T00:00:0{}.5Z 0 0 0 2\n"
    written(path, "QUATERNION", f"COMMENT text\n{row.format(1)}{row.format(3)}")
    text = path.read_text()
    path.write_text(text + text[text.index("META_START") :].replace("EME2000", "TOD"))
    first, second = read_aem(path)
    assert first.time.tolist() == second.time.tolist() == [0.0, 2.0]
    assert first.epoch == "2026-01-31T00:00:01.5"
    assert first.attitude.tolist() == [[1.0, 0.0, 0.0, 0.0]] * 2
    assert (first.metadata["REF_FRAME_A"], second.metadata["REF_FRAME_A"]) == ("EME2000", "TOD")


def test_a_file_in_utc_over_a_possible_leap_second_is_refused(tmp_path: Path) -> None:
    """These two times are 5 s apart, and were read as 4 s."""
    rows = "2016-12-31T23:59:58 0 0 0 1\n2017-01-01T00:00:02 0 0 0 1\n"
    path = written(tmp_path / "a.aem", "QUATERNION", rows)
    assert read_aem(path)[0].time.tolist() == [0.0, 4.0]
    path.write_text(path.read_text().replace("= TAI", "= UTC"))
    with pytest.raises(InputError, match="line 15"):
        read_aem(path)
    path.write_text(path.read_text().replace("12-31T23:59:58", "12-30T00:00:00"))
    path.write_text(path.read_text().replace("2017-01-01T00:00:02", "2016-12-31T00:00:01"))
    assert read_aem(path)[0].time.tolist() == [0.0, 86401.0]


def test_damaged_files_raise_no_other_error(tmp_path: Path) -> None:
    source = Random("aem 2611")
    path = tmp_path / "a.aem"
    text = written(
        path, "QUATERNION/ANGVEL", "DATA_START\n2026-01-31T00:00:00.5 0 0 0 1 1 2 3\nDATA_STOP\n"
    ).read_text()
    refused = []
    for _ in range(2000):
        lines = text.splitlines(keepends=True)
        place = source.randrange(len(lines))
        action = source.randrange(4)
        if action == 0:
            del lines[place]
        elif action == 1:
            lines.insert(source.randrange(len(lines)), lines[place])
        else:
            line = list(lines[place])
            line[source.randrange(len(line))] = source.choice("\0=0 9-TZ.eé\n")
            lines[place] = "".join(line)
        path.write_text("".join(lines))
        try:
            read_aem(path)
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 400
    assert not [each for each in refused if "\n" in each]


def test_epochs_are_exact() -> None:
    source = Random("epochs 2611")
    for _ in range(500):
        begin = read_epoch(
            "x", f"20{source.randrange(10, 99)}-12-31T23:{source.randrange(60):02}:07.1"
        )
        time = source.choice([1, -1]) * round(source.uniform(0.0, 1e6), 6)
        after = later(begin, time)
        assert seconds_between(begin, after) == time
        assert read_epoch("x", epoch_text(after)) == after


def test_orekit_reads_the_same(tmp_path: Path, found: Trajectory) -> None:
    orekit = pytest.importorskip("orekit_jpype", reason="orekit_jpype is not installed")
    orekit.initVM()
    # Its packages can be imported when the machine runs.
    from java.io import File  # type: ignore[import-not-found]
    from org.orekit.data import DataContext, DataSource, DirectoryCrawler  # type: ignore
    from org.orekit.files.ccsds.ndm import ParserBuilder  # type: ignore[import-not-found]

    data = tmp_path / "data"
    data.mkdir()
    (data / "tai-utc.dat").write_text(
        " 2017 JAN  1 =JD 2457754.5  TAI-UTC=  37.0       S + (MJD - 41317.) X 0.0      S\n"
    )
    providers = DataContext.getDefault().getDataProvidersManager()
    providers.addProvider(DirectoryCrawler(File(str(data))))
    path = tmp_path / "a.aem"
    write_aem(found, path, epoch=EPOCH, tolerance=1e-6)
    (segment,) = read_aem(path)
    message = ParserBuilder().buildAemParser().parseMessage(DataSource(str(path)))
    rows = message.getSegments().get(0).getData().getAngularCoordinates()
    assert rows.size() == len(segment.time)
    assert segment.omega is not None
    for row, q, omega in zip(rows, segment.attitude, segment.omega, strict=True):
        r, rate = row.getRotation(), row.getRotationRate()
        theirs = [r.getQ0(), r.getQ1(), r.getQ2(), r.getQ3()]
        np.testing.assert_allclose(theirs, q, atol=1e-15)
        np.testing.assert_allclose([rate.getX(), rate.getY(), rate.getZ()], omega, atol=1e-14)
