# SPDX-License-Identifier: Apache-2.0
"""The slew matrix: closed forms beside samples, walls beside a lattice, limits along the way."""

from collections import deque

import numpy as np
import pytest

from riem_planner import InvalidProblemError, Limits
from riem_planner.geometry import so3, sphere
from riem_planner.surveys import SlewVerdict, ZoneArray, matrix, pointings, slew_times

LIMITS = Limits(rate=0.01, acceleration=1e-4)
X = np.array([1.0, 0.0, 0.0])
# Three zones of a telescope, in the manner of Sun, Moon and Earth.
DIRECTIONS = np.array([[0.3, -0.9, -0.3], [-0.8, -0.1, 0.6], [0.5, 0.6, -0.7]])
HALF_ANGLES = np.radians([46.0, 25.0, 33.0])
ZONES = ZoneArray(("sun", "moon", "earth"), X, DIRECTIONS, HALF_ANGLES)
OVERLOOKED = 5e-5  # rad: what samples of a path 2,000 apart may overlook


def attitudes(rng, *shape):
    q = rng.normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def least_margin(slew, zones, samples=2001):
    R, _, _ = slew.evaluate(np.linspace(0.0, slew.duration, samples))
    axes = R @ zones.boresights.T
    distance = sphere.angle(np.swapaxes(axes, 1, 2), zones.directions)
    return float(np.min(distance - zones.half_angles))


def straight_slew(start, goal):
    return slew_times(start, goal, limits=LIMITS).trajectory(())


def check_flight(slew, start, goal, limits, tolerance=1e-9):
    """It leads from start to goal at rest, its rates are those of its attitudes, in limits."""
    t = np.linspace(0.0, slew.duration, 4001)
    R, v, a = slew.evaluate(t)
    ends = so3.quaternion_to_matrix(np.array([start, goal]))
    assert so3.distance(R[0], ends[0]) < 1e-9
    assert so3.distance(R[-1], ends[1]) < 1e-9
    assert np.abs(v[[0, -1]]).max() < 1e-12
    assert max(limits.used(v, a).values()) <= 1.0 + tolerance
    # Central differences, but for the intervals of jumps.
    turn = so3.log(np.swapaxes(R[:-2], 1, 2) @ R[2:]) / (t[2:] - t[:-2])[:, None]
    assert np.median(np.abs(turn - v[1:-1])) < 1e-5 * np.abs(v).max()
    change = (v[2:] - v[:-2]) / (t[2:] - t[:-2])[:, None]
    assert np.quantile(np.abs(change - a[1:-1]), 0.98) < 1e-3 * np.abs(a).max()


@pytest.mark.parametrize("angle", [1e-7, 0.5, 1.0, 1.5, 3.0])
def test_a_straight_slew_takes_the_least_time_of_its_axis(angle):
    goal = [0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)]
    result = slew_times([0, 0, 0, 1], goal, limits=LIMITS, settling_time=60.0)
    w, a = LIMITS.rate, LIMITS.acceleration
    expected = 2 * np.sqrt(angle / a) if angle <= w**2 / a else angle / w + w / a
    assert result.verdict == SlewVerdict.STRAIGHT
    assert result.time == pytest.approx(expected, rel=1e-12)
    assert result.straight_time == result.time
    assert result.settled == result.time + 60.0
    smooth = slew_times([0, 0, 0, 1], goal, limits=LIMITS, profile="smooth")
    assert smooth.time == pytest.approx(
        max(15 / 8 * angle / w, np.sqrt(10 / np.sqrt(3) * angle / a)), rel=1e-11
    )


def test_equal_attitudes_take_no_time():
    result = slew_times([0, 0, 0, 1], [0, 0, 0, -1], zones=ZONES, limits=LIMITS)
    assert (result.verdict, result.time) == (SlewVerdict.STRAIGHT, 0.0)
    slew = result.trajectory(())
    R, v, a = slew.evaluate(0.0)
    assert slew.duration == 0.0
    assert np.array_equal(R, np.eye(3))
    assert not v.any()
    assert not a.any()


@pytest.fixture(scope="module")
def random_pairs():
    rng = np.random.default_rng(20)
    starts, goals = attitudes(rng, 400), attitudes(rng, 400)
    return starts, goals, slew_times(starts, goals, zones=ZONES, limits=LIMITS)


def test_verdicts_are_those_of_sampled_paths(random_pairs):
    starts, goals, result = random_pairs
    counts = np.bincount(result.verdict, minlength=7)
    assert counts[SlewVerdict.STRAIGHT] > 130
    assert counts[SlewVerdict.DETOUR] > 30
    assert counts[[SlewVerdict.START_IN_ZONE, SlewVerdict.GOAL_IN_ZONE]].min() > 50
    assert counts[[SlewVerdict.SEALED, SlewVerdict.NOT_FOUND, SlewVerdict.INVALID]].sum() == 0
    for i, verdict in enumerate(result.verdict):
        straight = straight_slew(starts[i], goals[i])
        assert straight.duration == pytest.approx(result.straight_time[i], rel=1e-12)
        ends = [least_margin(straight_slew(q, q), ZONES, 1) for q in (starts[i], goals[i])]
        if verdict == SlewVerdict.START_IN_ZONE:
            assert ends[0] <= 0.0
        elif verdict == SlewVerdict.GOAL_IN_ZONE:
            assert ends[0] > 0.0 >= ends[1]
        elif verdict == SlewVerdict.STRAIGHT:
            assert least_margin(straight, ZONES) > 0.0
            assert result.time[i] == result.straight_time[i]
        else:
            assert least_margin(straight, ZONES) < OVERLOOKED
            assert least_margin(result.trajectory(i), ZONES) > 0.0
            assert result.time[i] > result.straight_time[i]


def test_detours_are_flights_within_the_limits_and_little_longer(random_pairs):
    starts, goals, result = random_pairs
    detours = np.flatnonzero(result.verdict == SlewVerdict.DETOUR)
    for i in detours[:25]:
        slew = result.trajectory((i,))
        assert slew.duration == result.time[i]
        check_flight(slew, starts[i], goals[i], LIMITS)
    ratio = result.time[detours] / result.straight_time[detours]
    assert np.median(ratio) < 1.10
    assert np.quantile(ratio, 0.95) < 1.5


@pytest.mark.parametrize("profile", ["fastest", "smooth"])
def test_a_detour_is_as_fast_as_its_path_allows(random_pairs, profile):
    # Somewhere a limit of the norms is used to the full.
    starts, goals, result = random_pairs
    chosen = np.flatnonzero(result.verdict == SlewVerdict.DETOUR)[:12]
    timed = slew_times(starts[chosen], goals[chosen], zones=ZONES, limits=LIMITS, profile=profile)
    for k in range(len(chosen)):
        slew = timed.trajectory((k,))
        check_flight(slew, starts[chosen[k]], goals[chosen[k]], LIMITS)
        _, v, a = slew.evaluate(np.linspace(0.0, slew.duration, 4001))
        assert max(LIMITS.used(v, a).values()) > 1.0 - 1e-5


def test_an_edge_decides_to_a_billionth_of_a_radian():
    # From x to y about z the boresight passes the zone's axis at just its latitude.
    start, goal = [0, 0, 0, 1], [0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)]
    for latitude in (1e-3, 0.3, 1.2):
        z = [np.cos(latitude) / np.sqrt(2), np.cos(latitude) / np.sqrt(2), np.sin(latitude)]
        for off, verdict in ((1e-9, SlewVerdict.STRAIGHT), (-1e-9, SlewVerdict.DETOUR)):
            zones = ZoneArray(("a",), X, [z], [latitude - off])
            assert slew_times(start, goal, zones=zones, limits=LIMITS).verdict == verdict
    # The start on the edge is in the zone; half angle 0 is a point.
    zones = ZoneArray(("a",), X, [[0, 0, 1]], [np.pi / 2])
    verdict = slew_times(start, goal, zones=zones, limits=LIMITS).verdict
    assert verdict == SlewVerdict.START_IN_ZONE
    point = ZoneArray(("a",), X, [[1, 1, 0]], [0.0])
    assert slew_times(start, goal, zones=point, limits=LIMITS).verdict == SlewVerdict.DETOUR


def test_a_half_turn_chooses_its_side():
    start, goal = [0, 0, 0, 1], [0, 0, 1, 0]
    for y in (1.0, -1.0):
        zones = ZoneArray(("a",), X, [[0, y, 0]], [0.5])
        result = slew_times(start, goal, zones=zones, limits=LIMITS)
        assert result.verdict == SlewVerdict.STRAIGHT
        assert least_margin(result.trajectory(()), zones) > 0.0


def lattice_parts(zones, points, links, spacing):
    """Labels of the parts of a lattice's points that are certainly, and possibly, allowed."""
    distance = sphere.angle(points[:, None], zones.directions) - zones.half_angles
    labels = []
    for grown in (spacing, -spacing):
        allowed = np.all(distance > grown, axis=1)
        label = np.full(len(points), -1)
        for seed in np.flatnonzero(allowed):
            if label[seed] < 0:
                label[seed], queue = seed, deque([seed])
                while queue:
                    for other in links[queue.popleft()]:
                        if allowed[other] and label[other] < 0:
                            label[other] = seed
                            queue.append(other)
        labels.append(label)
    return labels


def test_sealed_and_open_are_those_of_a_lattice():
    rng = np.random.default_rng(5)
    count = 2500
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    azimuth = np.pi * (1 + np.sqrt(5)) * k
    points = np.stack([*(np.sqrt(1 - z**2) * f(azimuth) for f in (np.cos, np.sin)), z], axis=-1)
    spacing = 0.11  # neighbours: within it; half of it covers the sphere
    close = points @ points.T > np.cos(spacing)
    links = [np.flatnonzero(row) for row in close]
    sealed = opened = 0
    for _ in range(20):
        n = int(rng.integers(9, 15))
        zones = ZoneArray(
            tuple("abcdefghijklmno"[:n]), X, rng.normal(size=(n, 3)), rng.uniform(0.4, 0.8, n)
        )
        sure, possible = lattice_parts(zones, points, links, spacing / 2)
        inside = np.flatnonzero(sure >= 0)
        if inside.size < 2:
            continue
        pairs = rng.choice(inside, (12, 2))
        turns = [so3.minimal_rotation(X, p) for p in points[pairs].reshape(-1, 3)]
        ends = np.stack(turns).reshape(12, 2, 4)
        result = slew_times(ends[:, 0], ends[:, 1], zones=zones, limits=LIMITS)
        for (i, j), verdict in zip(pairs, result.verdict, strict=True):
            if sure[i] == sure[j]:
                assert verdict in (SlewVerdict.STRAIGHT, SlewVerdict.DETOUR)
                opened += 1
            if possible[i] != possible[j]:
                assert verdict == SlewVerdict.SEALED
                sealed += 1
    assert sealed > 10
    assert opened > 50


def test_a_ring_of_zones_seals_and_one_gap_opens_it():
    angles = np.radians(np.arange(0, 360, 45))
    ring = np.stack([0 * angles, np.cos(angles), np.sin(angles)], axis=-1)
    start, goal = [0, 0, 0, 1], [0, 0, 1, 0]  # x and -x
    for half_angle, verdict in ((23.0, SlewVerdict.SEALED), (22.0, SlewVerdict.DETOUR)):
        zones = ZoneArray(tuple("abcdefgh"), X, ring, np.radians([half_angle] * 8))
        result = slew_times(start, goal, zones=zones, limits=LIMITS)
        assert result.verdict == verdict
    sealed = slew_times(start, goal, zones=ZoneArray(tuple("abcdefgh"), X, ring, [0.41] * 8),
                        limits=LIMITS)  # fmt: skip
    assert sealed.time == np.inf
    with pytest.raises(ValueError, match="SEALED"):
        sealed.trajectory(())


def test_several_boresights_are_planned_and_sealed_one_by_one():
    boresights = np.array([X, [0.0, 1.0, 0.0]])
    zones = ZoneArray(("camera", "tracker"), boresights, [[1, 1, 0.1], [-0.4, 0.2, 1]], [0.5, 0.3])
    start, goal = np.array([0, 0, 0, 1.0]), np.array([0, 0, np.sin(0.9), np.cos(0.9)])
    result = slew_times(start, goal, zones=zones, limits=LIMITS)
    assert result.verdict == SlewVerdict.DETOUR
    slew = result.trajectory(())
    assert slew.duration == result.time
    assert least_margin(slew, zones) > 0.0
    check_flight(slew, start, goal, LIMITS, tolerance=1e-3)
    angles = np.radians(np.arange(0, 360, 45))
    ring = np.stack([0 * angles, np.cos(angles), np.sin(angles)], axis=-1)
    walls = ZoneArray(
        tuple("abcdefghi"), np.array([X] * 8 + [[0, 1, 0]]), [*ring, [0, 0, 1]], [0.41] * 8 + [0.1]
    )
    assert slew_times([0, 0, 0, 1], [0, 0, 1, 0], zones=walls, limits=LIMITS).verdict == 2


INERTIA = np.array([[900.0, 30.0, -20.0], [30.0, 1200.0, 15.0], [-20.0, 15.0, 500.0]])


@pytest.mark.parametrize("profile", ["fastest", "smooth"])
@pytest.mark.parametrize(
    "limits",
    [
        Limits(rate=[0.01, 0.004, 0.02], acceleration=[1e-4, 2e-4, 3e-5]),
        Limits(torque=0.05, momentum=6.0, inertia=INERTIA),
        Limits(torque=[0.05, 0.08, 0.02], momentum=[5.0, 4.0, 6.0], inertia=INERTIA),
        Limits(rate=0.02, acceleration=1e-4, torque=0.3, inertia=INERTIA),
        Limits(acceleration=1e-4),
    ],
    ids=["axes", "wheels", "wheels by axis", "mixed", "acceleration alone"],
)
def test_other_limits_hold_along_straight_slews_and_detours(random_pairs, limits, profile):
    starts, goals, known = random_pairs
    chosen = [*np.flatnonzero(known.verdict == SlewVerdict.DETOUR)[:6],
              *np.flatnonzero(known.verdict == SlewVerdict.STRAIGHT)[:6]]  # fmt: skip
    s, g = starts[chosen], goals[chosen]
    result = slew_times(s, g, zones=ZONES, limits=limits, profile=profile)
    assert np.array_equal(result.verdict, known.verdict[chosen])
    for k in range(len(chosen)):
        check_flight(result.trajectory(k), s[k], g[k], limits)
        straight = slew_times(s[k], g[k], limits=limits, profile=profile)
        _, v, a = straight.trajectory(()).evaluate(np.linspace(0, float(straight.time), 2001))
        if limits.torque is None:  # with the gyroscopic part, a limit may bind only at the top
            assert max(limits.used(v, a).values()) > 1.0 - 1e-6


def test_axis_limits_are_those_of_the_formula():
    limits = Limits(rate=[0.01, 0.004, 0.02], acceleration=[1e-4, 2e-4, 3e-5])
    axis, angle = np.array([0.48, 0.6, 0.64]), 2.0
    goal = [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]
    w, a = np.min(limits.rate / axis), np.min(limits.acceleration / axis)
    expected = angle / w + w / a if angle > w * w / a else 2 * np.sqrt(angle / a)
    result = slew_times([0, 0, 0, 1], goal, limits=limits)
    assert result.time == pytest.approx(expected, rel=1e-12)
    wheels = Limits(torque=0.05, momentum=6.0, inertia=INERTIA)
    w, a = 6.0 / np.linalg.norm(INERTIA @ axis), 0.05 / np.linalg.norm(INERTIA @ axis)
    blind = angle / w + w / a if angle > w * w / a else 2 * np.sqrt(angle / a)
    assert blind < slew_times([0, 0, 0, 1], goal, limits=wheels).time < 1.3 * blind


def test_dimensions_broadcast_and_epochs_are_one_more_axis():
    rng = np.random.default_rng(3)
    q = attitudes(rng, 5)
    epochs = so3.exp(np.outer(np.linspace(0, 3, 4), [0, 0, 1.0])) @ DIRECTIONS[0]
    zones = ZoneArray(("sun",), X, epochs[:, None, None, None], [0.8])
    result = slew_times(q[:, None], q[None], zones=zones, limits=LIMITS)
    assert result.time.shape == result.verdict.shape == result.settled.shape == (4, 5, 5)
    assert result.verdict.dtype == np.int8
    for index in np.ndindex(result.time.shape):
        e, i, j = index
        one = ZoneArray(("sun",), X, epochs[e][None], [0.8])
        alone = slew_times(q[i], q[j], zones=one, limits=LIMITS)
        assert (alone.verdict, alone.time) == (result.verdict[index], result.time[index])
        if alone.verdict <= 1 and alone.time > 0:
            assert result.trajectory(index).duration == result.time[index]


def test_parts_and_threads_change_nothing(monkeypatch, random_pairs):
    starts, goals, result = random_pairs
    monkeypatch.setattr(matrix, "_CHUNK", 37)
    again = slew_times(starts, goals, zones=ZONES, limits=LIMITS, jobs=3)
    assert np.array_equal(again.time, result.time)
    assert np.array_equal(again.verdict, result.verdict)


def test_what_is_not_finite_is_invalid_and_nothing_else_is():
    q = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
    q[1, 2] = np.nan
    directions = np.tile(DIRECTIONS, (3, 1, 1))
    directions[2, 1, 0] = np.nan
    zones = ZoneArray(ZONES.names, X, directions, HALF_ANGLES)
    result = slew_times(q, [0, 0, 0.6, 0.8], zones=zones, limits=LIMITS)
    assert [*(result.verdict == SlewVerdict.INVALID)] == [False, True, True]
    assert [*np.isnan(result.time)] == [False, True, True]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"start": [0, 0, 0, 1.1]}, "start"),
        ({"goal": [0, 0, 1]}, "goal"),
        ({"limits": 3.0}, "limits"),
        ({"limits": Limits(rate=1.0, jerk=1.0)}, "limits.jerk"),
        ({"profile": "quick"}, "profile"),
        ({"settling_time": -1.0}, "settling_time"),
        ({"jobs": 0}, "jobs"),
        ({"zones": "sun"}, "zones"),
        (
            {"start": np.tile([0, 0, 0, 1.0], (2, 1)), "goal": np.tile([0, 0, 0, 1.0], (3, 1))},
            "zones",
        ),
    ],
)
def test_wrong_inputs_are_named(change, key):
    given = {"start": [0, 0, 0, 1], "goal": [0, 0, 0.6, 0.8], "zones": ZONES, "limits": LIMITS}
    given |= change
    with pytest.raises(InvalidProblemError, match=f"^{key}: "):
        slew_times(given.pop("start"), given.pop("goal"), **given)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((("a", "a"), X, [X, X], [0.1, 0.1]), "names"),
        ((("a",), X, [[0, 0, 0]], [0.1]), "directions"),
        ((("a",), [[X]], [X], [0.1]), "boresights"),
        ((("a",), X, [X], [3.2]), "half_angles"),
        ((("a",), X, [X], [0.1, 0.2]), "half_angles"),
        ((("a",), X, np.ones((3, 1, 3)), np.ones((2, 1))), "half_angles"),
    ],
)
def test_wrong_zones_are_named(arguments, key):
    with pytest.raises(InvalidProblemError, match=f"^{key}: "):
        ZoneArray(*arguments)


def test_pointings_hold_the_target_and_turn_about_it():
    rng = np.random.default_rng(1)
    target, sun = rng.normal(size=(2, 50, 3))
    R = so3.quaternion_to_matrix(pointings(target, sun=sun))
    assert sphere.angle(R[:, :, 0], target).max() < 1e-14
    assert np.abs(np.einsum("ni,ni->n", R[:, :, 1], sun)).max() < 1e-14
    assert np.all(np.einsum("ni,ni->n", np.cross(sun, target), R[:, :, 1]) > 0.0)
    rolled = so3.quaternion_to_matrix(pointings(target, sun=sun, roll=0.3))
    assert so3.distance(rolled, R @ so3.exp([0.3, 0.0, 0.0])).max() < 1e-14
    near = [[1.0, 0.0, 0.9e-6], [-1.0, 0.9e-6, 0.0], [1.0, 1.1e-6, 0.0], [np.nan, 0.0, 1.0]]
    assert [*np.isnan(pointings(near, sun=X)).any(axis=1)] == [True, True, False, True]
