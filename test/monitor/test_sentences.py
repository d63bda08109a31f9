# SPDX-License-Identifier: Apache-2.0
"""A spoiled stream is found within two setpoints, for each sentence; an honest one never."""

import ast
import math
import random
from dataclasses import replace
from pathlib import Path

import pytest

import riem_planner.monitor
from riem_planner.monitor.curve import State, between, norm, turn_between
from riem_planner.monitor.sentences import SENTENCES, Monitor, Rules, Zone

T, RATE = 20.0, 50.0
SECOND = 1_000_000_000
SUN = Zone("sun", False, (1.0, 0.0, 0.0), 0.2, direction=(0.0, 0.0, 1.0), timeout=5.0)
EARTH = Zone("earth", True, (0.0, 0.0, 1.0), 0.3, direction=(0.0, 0.0, 1.0))
RULES = Rules(
    RATE, (SUN, EARTH), {"rate": (0.1,), "torque": (0.1, 0.1, 0.1)},
    (1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0),
)  # fmt: skip


def state(t, turn=1.2):
    """A rest-to-rest turn about z."""
    s = min(max(t / T, 0.0), 1.0)
    angle = turn * (3 * s**2 - 2 * s**3)
    rate = turn * 6 * (s - s**2) / T
    acceleration = turn * (6 - 12 * s) / T**2 if t <= T else 0.0
    q = (0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))
    return State(round(t * SECOND), q, (0.0, 0.0, rate), (0.0, 0.0, acceleration))


def reference(samples=41):
    return [state(T * k / (samples - 1)) for k in range(samples)]


def flown(monitor, until=T, since=0.0):
    """Hear an honest stream."""
    for k in range(round(since * RATE), round(until * RATE)):
        monitor.setpoint(state(k / RATE))


def ready(until=8.0, rules=RULES):
    monitor = Monitor(rules)
    monitor.reference(reference())
    flown(monitor, until)
    assert monitor.verdict is None, monitor.verdict
    return monitor


@pytest.mark.requirement("RP-017")
def test_an_honest_stream_breaks_nothing():
    monitor = ready(T + 5.0)
    assert monitor.setpoints == 1250


def spoiled(k, **change):
    return state(8.0 + k / RATE)._replace(**change)


def turned(k, angle):
    """The setpoint, turned about x."""
    x, y, z, w = state(8.0 + k / RATE).q
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return spoiled(k, q=(w * s + x * c, y * c + z * s, z * c - y * s, w * c - x * s))


@pytest.mark.parametrize(("sentence", "stream"), [
    ("M1", [spoiled(0, q=tuple(-x for x in state(8.0).q))]),
    ("M1", [spoiled(0, q=tuple(x * (1 + 2e-6) for x in state(8.0).q))]),
    ("M2", [spoiled(0), spoiled(0)]),
    ("M2", [spoiled(0), spoiled(4)]),
    ("M3", [turned(0, 0.01)]),
    ("M5", [spoiled(0, v=(0.0, 0.0, 0.11))]),
    ("M5", [spoiled(0, a=(0.0, 0.0, 0.1 / 3 + 1e-6))]),
    ("M6", [turned(0, 2e-6), turned(1, 2e-6)]),
])  # fmt: skip
@pytest.mark.requirement("RP-017")
def test_a_spoiled_stream_is_found_within_two_setpoints(sentence, stream):
    monitor = ready()
    for setpoint in stream:
        monitor.setpoint(setpoint)
    assert sentence in {violation.sentence for violation in monitor.violations}
    assert monitor.verdict.what


def test_a_zone_that_is_entered_is_found_unless_a_way_out_is_flown():
    for told, expected in (("FLYING", {"M4"}), ("WAY_OUT", set())):
        monitor = ready()
        # It comes over the boresight of 8 s, and the planner has half a second to answer.
        x, y = (f(2.0 * math.asin(state(9.0).q[2])) for f in (math.cos, math.sin))
        monitor.zone("sun", (x, y, 0.0), 8 * SECOND, 8 * SECOND)
        monitor.status(told, "", 8 * SECOND, warns=False)
        flown(monitor, 8.4, 8.0)
        assert monitor.verdict is None
        flown(monitor, 8.6, 8.4)
        assert {violation.sentence for violation in monitor.violations} == expected


def test_of_a_group_one_member_is_enough():
    lost = replace(EARTH, name="lost", direction=(1.0, 0.0, 0.0), group="g")
    seen = replace(EARTH, group="g")
    assert ready(rules=replace(RULES, zones=(lost, seen))).verdict is None
    monitor = Monitor(replace(RULES, zones=(lost,)))
    flown(monitor, 0.1)
    assert monitor.verdict.sentence == "M4"


@pytest.mark.requirement("RP-018")
def test_a_stop_that_is_announced_must_end_in_time():
    monitor = ready()
    monitor.status(
        "CANCELLED", "cancelled: a certified stop within 0.1 s and hold", 8 * SECOND, warns=False
    )
    flown(monitor, 8.2, 8.0)
    assert [violation.sentence for violation in monitor.violations] == ["M7"]


@pytest.mark.requirement("RP-018")
def test_a_stop_that_ends_in_time_is_honest():
    monitor = ready(T - 1.0)
    monitor.status(
        "CANCELLED", "cancelled: a certified stop within 1.5 s and hold", 19 * SECOND, warns=False
    )
    flown(monitor, T + 2.0, T - 1.0)
    assert monitor.verdict is None


@pytest.mark.parametrize(("warns", "expected"), [(False, ["M8"]), (True, [])])
@pytest.mark.requirement("RP-019")
def test_an_input_that_falls_silent_must_be_warned_of(warns, expected):
    monitor = ready()
    monitor.zone("sun", (0.0, 0.0, 1.0), 8 * SECOND, 8 * SECOND)
    if warns:
        monitor.status("", "zone sun is old", round(13.5 * SECOND), warns=True)
    for tenth in range(90, 150):
        monitor.tick(tenth * SECOND // 10)
    assert [violation.sentence for violation in monitor.violations] == expected


def test_a_replan_is_judged_by_the_reference_that_came_for_it():
    monitor = ready()
    later = [s._replace(stamp_ns=s.stamp_ns + SECOND) for s in reference()]
    monitor.reference([s for s in later if s.stamp_ns >= 9 * SECOND])
    flown(monitor, 9.0, 8.0)
    assert monitor.verdict is None
    flown(monitor, 9.1, 9.0)  # it should follow the new one
    assert monitor.verdict.sentence == "M6"


def test_the_curve_between_samples_is_that_of_the_flight():
    samples = reference(21)
    for k in range(20):
        middle = (samples[k].stamp_ns + samples[k + 1].stamp_ns) // 2
        found = between(samples[k], samples[k + 1], middle)
        assert norm(turn_between(state(middle / SECOND).q, found)) < 1e-8


def test_every_sentence_is_stated():
    assert list(SENTENCES) == [f"M{i}" for i in range(1, 9)]


@pytest.mark.requirement("RP-024")
def test_it_shares_nothing_with_what_it_judges():
    for path in Path(riem_planner.monitor.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            module = getattr(node, "module", None) or ""
            if isinstance(node, ast.ImportFrom) and module.startswith("riem_planner"):
                assert module.startswith("riem_planner.monitor"), path
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not {"numpy", "numba", "scipy"} & {*names}


@pytest.mark.soak
def test_ten_thousand_seconds_of_honest_flight_raise_no_alarm():
    random.seed(1)
    monitor = Monitor(Rules(RATE))
    t, turn = 0.0, 0.0
    while t < 10_000.0:
        # Slews about z, one after another, each from the last one's end.
        length, by = random.uniform(20.0, 200.0), random.uniform(-1.5, 1.5)
        samples = [_slew(t, turn, by, length, length * k / 120) for k in range(121)]
        monitor.reference(samples)
        for k in range(round(length * RATE)):
            monitor.setpoint(_slew(t, turn, by, length, k / RATE))
        t, turn = t + round(length * RATE) / RATE, turn + by
    assert monitor.verdict is None, monitor.verdict
    assert monitor.setpoints > 490_000


def _slew(begin, turn, by, length, since):
    s = min(since / length, 1.0)
    angle = turn + by * (10 * s**3 - 15 * s**4 + 6 * s**5)
    rate = by * 30 * s**2 * (1 - s) ** 2 / length
    acceleration = by * 60 * s * (1 - s) * (1 - 2 * s) / length**2
    q = (0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))
    return State(round((begin + since) * SECOND), q, (0.0, 0.0, rate), (0.0, 0.0, acceleration))
