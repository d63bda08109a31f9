# SPDX-License-Identifier: Apache-2.0
"""Timelines: a sky and observations made here, through the command, judged by samples."""

from itertools import pairwise

import numpy as np
import pytest

pytestmark = pytest.mark.extras

SPACECRAFT = """
boresight: [1, 0, 0]
limits: {rate: 0.01, acceleration: 1.0e-4}
settling_time: 60.0
zones:
  - {name: sun, body: sun, half_angle_deg: 40}
  - {name: earth, body: earth, limb_angle_deg: 20}
"""
HALF_ANGLES = {"sun": 40.0, "earth": 32.0}


def bodies(times):
    """Sun, and an Earth that goes round every two hours, with a limb that breathes."""
    slow, fast = 2e-7 * times + 1.0, 2 * np.pi * times / 7200.0
    sun = np.stack([np.cos(slow), np.sin(slow), 0.1 + 0 * slow], axis=-1)
    earth = np.stack([0.3 + 0 * fast, np.cos(fast), np.sin(fast)], axis=-1)
    return {"sun": sun, "earth": earth}


def write_sky(path, end, step=60.0):
    times = np.arange(0.0, end + step, step)
    columns = [times]
    for vectors in bodies(times).values():
        columns += [*vectors.T]
    columns.append(12.0 + np.sin(times / 900.0))
    names = "time_s,sun_x,sun_y,sun_z,earth_x,earth_y,earth_z,earth_limb_deg"
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=names, comments="")


def rows_of(folder, name):
    from pyarrow import parquet

    return parquet.read_table(folder / f"{name}.parquet").to_pylist()


def random_timeline(seed, count, slack):
    """Fields all over the sky with gaps for straight slews and `slack` seconds more."""
    rng = np.random.default_rng(seed)
    return timeline(*(np.degrees(rng.uniform(-w, w, count)) for w in (3.1, 1.4, 3.1)), slack)


def timeline(ra, dec, roll, slack):
    from riem_planner import Limits
    from riem_planner.surveys import celestial_attitudes, slew_times

    q = celestial_attitudes(*np.radians([ra, dec, roll]))
    blind = slew_times(q[:-1], q[1:], limits=Limits(rate=0.01, acceleration=1e-4)).time
    starts = np.concatenate([[0.0], np.cumsum(blind + 60.0 + slack + 300.0)])
    return starts, np.full(len(ra), 300.0), ra, dec, roll


def write_observations(path, starts, durations, ra, dec, roll):
    lines = ["id,start_s,duration_s,ra_deg,dec_deg,roll_deg"]
    lines += [
        f"{i},{s:.9f},{d:.9f},{a:.12f},{b:.12f},{c:.12f}"
        for i, (s, d, a, b, c) in enumerate(zip(starts, durations, ra, dec, roll, strict=True))
    ]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs the command on observations; folder and exit code."""
    from riem_planner.riem_timeline.command import main

    def run(table, *options, sky_end=None):
        folder = tmp_path_factory.mktemp("timeline")
        (folder / "craft.yaml").write_text(SPACECRAFT)
        write_observations(folder / "obs.csv", *table)
        write_sky(
            folder / "sky.csv", (table[0] + table[1])[-1] + 3600 if sky_end is None else sky_end
        )
        code = main(
            [str(folder / "obs.csv"), "--spacecraft", str(folder / "craft.yaml"), "--sky",
             str(folder / "sky.csv"), "--output", str(folder), *options]
        )  # fmt: skip
        return folder, code

    return run


@pytest.fixture(scope="module")
def survey(run):
    table = random_timeline(4, 120, 120.0)
    folder, code = run(table)
    return table, folder, code, rows_of(folder, "segments"), rows_of(folder, "reference")


def reference_pieces(rows):
    """Trajectories between jumps, with their begin."""
    from riem_planner import Trajectory

    t = np.array([row["time_s"] for row in rows])
    q = np.array([[row[f"orientation_{c}"] for c in "xyzw"] for row in rows])
    v = np.array([[row[f"angular_velocity_{c}"] for c in "xyz"] for row in rows])
    a = np.array([[row[f"angular_acceleration_{c}"] for c in "xyz"] for row in rows])
    ends = [0, *(np.flatnonzero(np.diff(t) == 0.0) + 1), len(t)]
    for first, last in pairwise(ends):
        part = slice(first, last)
        yield t[first], Trajectory(t[part] - t[first], q[part], v[part], a[part])


def test_segments_follow_each_other_and_the_plan(survey):
    (starts, durations, *_), _, code, segments, _ = survey
    assert code == 3
    kinds = [row["kind"] for row in segments]
    assert kinds == ["hold", *["slew", "wait", "hold"] * (len(starts) - 1)]
    begin = np.array([row["start_s"] for row in segments])
    end = begin + [row["duration_s"] for row in segments]
    assert np.abs(begin[1:] - end[:-1]).max() < 1e-6
    for row in segments:
        assert row["certified"] == (row["reason"] is None)
        i = row["observation"]
        if row["kind"] == "hold":
            assert row["late_s"] == pytest.approx(row["start_s"] - starts[i], abs=1e-6)
            assert (row["reason"] == "late") <= (row["late_s"] > 0.010)
            assert row["start_s"] + row["duration_s"] == pytest.approx(starts[i] + durations[i])
        if row["kind"] == "slew":
            assert row["start_s"] == pytest.approx(starts[i - 1] + durations[i - 1], abs=1e-6)


def test_verdicts_and_clearances_are_those_of_samples_of_the_reference(survey):
    from riem_planner.geometry import sphere

    _, folder, _, segments, rows = survey
    sky = np.genfromtxt(folder / "sky.csv", delimiter=",", names=True)
    pieces = list(reference_pieces(rows))
    counts = {}
    for row in segments:
        counts[row["verdict"] or row["kind"]] = counts.get(row["verdict"] or row["kind"], 0) + 1
        t = row["start_s"] + np.linspace(0, row["duration_s"], 600)
        t = np.clip(t, pieces[0][0], pieces[-1][0] + pieces[-1][1].duration)
        R = np.empty((t.size, 3, 3))
        for begin, piece in pieces:
            inside = (t >= begin) & (t <= begin + piece.duration)
            if inside.any():
                R[inside] = piece.evaluate(t[inside] - begin)[0]
        for body, half_angle in (("sun", 40.0), ("earth", None)):
            # Chords between rows a minute apart leave great circles by less than 1e-4 deg here.
            axis = np.stack([np.interp(t, sky["time_s"], sky[f"{body}_{c}"]) for c in "xyz"], -1)
            radius = half_angle or 20.0 + np.interp(t, sky["time_s"], sky["earth_limb_deg"])
            least = np.min(np.degrees(sphere.angle(R[:, :, 0], axis)) - radius)
            told = row[f"clearance_deg_{body}"]
            if row["certified"] or row["reason"] == "late":
                assert 0.0 < told <= least + 1e-3
                assert least - told < 0.02 + 0.02 * least
            elif row["reason"] != "late":
                assert told < least + 1e-3 or told <= 0.0
        if not row["certified"] and row["reason"] != "late":
            assert min(row["clearance_deg_sun"], row["clearance_deg_earth"]) <= 0.0
    assert counts["straight"] > 20
    assert counts["detour"] > 5
    assert counts["start_in_zone"] > 5


def test_the_reference_is_continuous_and_within_the_limits(survey):
    *_, rows = survey
    pieces = list(reference_pieces(rows))
    for (begin, piece), (after, following) in pairwise(pieces):
        assert after == pytest.approx(begin + piece.duration, abs=1e-7)
        q, v, _ = piece.evaluate_quaternion(piece.duration)
        assert np.abs(q - following.quaternions_xyzw[0]).max() < 1e-9
        assert np.abs(v - following.angular_velocities[0]).max() < 1e-9
    for _, piece in pieces:
        _, v, a = piece.evaluate(np.linspace(0.0, piece.duration, 50))
        assert np.linalg.norm(v, axis=1).max() <= 0.01 * (1 + 1e-7)
        assert np.linalg.norm(a, axis=1).max() <= 1e-4 * (1 + 1e-7)


def test_a_straight_slew_that_just_fits_is_not_late(run):
    # Away from the Sun, and from the Earth as it is then.
    starts, durations, *angles = timeline([-100.0, -90.0], [0.0, -50.0], [0.0, 30.0], 0.0)
    for early, late in ((0.009, False), (0.011, True)):
        shifted = starts - np.array([0.0, early])
        folder, _ = run((shifted, durations, *angles))
        hold = rows_of(folder, "segments")[-1]
        assert hold["late_s"] == pytest.approx(early, abs=1e-6)
        assert (hold["reason"] == "late") == late


def test_strict_writes_no_reference_where_conflicts_remain(run, capsys):
    table = random_timeline(4, 12, 120.0)
    folder, code = run(table, "--strict", "--jobs", "2")
    assert code == 3
    assert not (folder / "reference.parquet").exists()
    told = capsys.readouterr().err
    assert "conflicts" in told
    assert "in_zone" in told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: (t[0] - [0, 400, 0], *t[1:]), "start_s, row 1"),
        (lambda t: (t[0], t[1] * -1, *t[2:]), "duration_s, row 0"),
        (lambda t: (t[0] * [1, 1, np.nan], *t[1:]), "start_s, row 2"),
    ],
)
def test_wrong_observations_are_named(run, capsys, change, words):
    table = random_timeline(2, 3, 60.0)
    _, code = run(change(table), sky_end=7200)
    assert code == 2
    assert words in capsys.readouterr().err


def test_a_sky_too_short_is_told(run, capsys):
    _, code = run(random_timeline(2, 5, 60.0), sky_end=600)
    assert code == 2
    assert "time_s" in capsys.readouterr().err


def test_tables_of_every_kind_say_the_same(tmp_path):
    from pyarrow import csv, parquet

    from riem_planner.riem_timeline.inputs import read_observations

    write_observations(tmp_path / "a.csv", *random_timeline(2, 4, 60.0))
    table = csv.read_csv(tmp_path / "a.csv")
    parquet.write_table(table, tmp_path / "b.parquet")
    header = ["# %ECSV 1.0", "# ---", "# datatype:"]
    header += [f"# - {{name: {name}, datatype: float64}}" for name in table.column_names]
    body = (tmp_path / "a.csv").read_text().replace(",", " ")
    (tmp_path / "c.ecsv").write_text("\n".join(header) + "\n" + body)
    first, *others = (read_observations(tmp_path / n) for n in ("a.csv", "b.parquet", "c.ecsv"))
    for other in others:
        assert np.array_equal(first.attitudes, other.attitudes)
        assert np.array_equal(first.start, other.start)


def test_the_report_is_a_picture(run, tmp_path):
    picture = tmp_path / "report.png"
    run(random_timeline(4, 12, 120.0), "--report", str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")
