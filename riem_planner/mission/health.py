# SPDX-License-Identifier: Apache-2.0
"""Health of the node: bad messages, age of inputs, jitter of the stream, tracking."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.mission.codes import Level
from riem_planner.mission.mission import NO_CLOCK, Mission
from riem_planner.mission.safety import Judge
from riem_planner.mission.timeline import Setpoint

Array = NDArray[np.float64]

WARNING_EVERY = 5.0
"""Time between two warnings about one field of one input [s]."""
MOST_TOLD = 10
"""Refusals of a topic that are told in a second, one by one."""


class Health(NamedTuple):
    """One entry of /diagnostics."""

    name: str
    level: Level
    message: str
    values: dict[str, object]


class Rejections:
    """Counts bad messages per input, and says when a warning is due and what may be told.

    Parameters
    ----------
    clock
        A steady clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.counts: dict[str, int] = {}
        self.last: dict[str, str] = {}
        self._clock = clock
        self._warned: dict[tuple[str, str], float] = {}
        self._told: dict[str, tuple[float, int]] = {}

    def note(self, topic: str, field: str, problem: str) -> str | None:
        """Count a bad message; the warning to give, or None if one was given just now."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.last[topic] = problem
        now = self._clock()
        if now - self._warned.get((topic, field), -math.inf) < WARNING_EVERY:
            return None
        self._warned[topic, field] = now
        return f"message on {topic} rejected: {problem}; the last good data is kept"

    def admit(self, topic: str) -> bool:
        """Whether one more refusal of a topic may be told in this second."""
        begin, count = self._told.get(topic, (self._clock(), 0))
        if self._clock() - begin >= 1.0 and count <= MOST_TOLD:
            begin, count = self._clock(), 0
        self._told[topic] = (begin, count + 1)
        return count < MOST_TOLD

    def untold(self) -> dict[str, int]:
        """How many more refusals there were of each topic whose second is over."""
        over = {
            topic: count - MOST_TOLD
            for topic, (begin, count) in self._told.items()
            if count > MOST_TOLD and self._clock() - begin >= 1.0
        }
        for topic in over:
            del self._told[topic]
        return over


class StreamWatch:
    """Intervals between setpoints, by a steady clock."""

    def __init__(self) -> None:
        self.published = 0
        self._intervals: deque[float] = deque(maxlen=2000)
        self._last: float | None = None

    def note(self, now: float) -> None:
        """A setpoint was published at a time [s]."""
        self.published += 1
        if self._last is not None:
            self._intervals.append(now - self._last)
        self._last = now

    def pause(self) -> None:
        """The stream ends here; the gap to its next setpoint is not counted."""
        self._last = None

    def report(self, period: float, *, realtime: bool) -> Health:
        """Jitter of the last setpoints; a warning if some came late by more than a period [s]."""
        values: dict[str, object] = {"published": self.published, "real_time_priority": realtime}
        if not self._intervals:
            return Health("stream", Level.OK, "nothing is streamed", values)
        intervals = np.array(self._intervals)
        self._intervals.clear()
        late = int(np.sum(intervals > 2.0 * period))
        values["interval_median_ms"] = 1e3 * float(np.median(intervals))
        values["interval_p99_ms"] = 1e3 * float(np.quantile(intervals, 0.99))
        values["interval_max_ms"] = 1e3 * float(intervals.max())
        values["late"] = late
        if late:
            return Health("stream", Level.WARN, f"{late} setpoints were late", values)
        return Health("stream", Level.OK, "on time", values)


def planner_health(mission: Mission, now_ns: int) -> Health:
    """State of the planner and clearance of what flies."""
    doing = mission.doing(now_ns)
    values: dict[str, object] = {"state": doing, "planning": mission.pending is not None}
    verdict = mission.verdict
    if verdict is not None and mission.timeline:
        values["certified"] = verdict.certified
        for name, clearance in verdict.clearance.items():
            values[f"clearance_deg.{name}"] = math.degrees(clearance)
    if not now_ns:
        return Health("planner", Level.WARN, NO_CLOCK, values)
    if mission.leaving:
        return Health("planner", Level.ERROR, "inside a zone: flying the way out", values)
    if mission.timeline and verdict is not None and not verdict.certified:
        return Health("planner", Level.ERROR, "what flies is not certified", values)
    return Health("planner", Level.OK, doing, values)


def inputs_health(mission: Mission, rejections: Rejections, now_ns: int) -> Health:
    """Age of what came in, and how much was rejected."""
    world = mission.world
    values: dict[str, object] = {}
    for source in dict.fromkeys(zone.source for zone in mission.settings.zones):
        age = world.age(source, now_ns)
        values[f"age_s.{source}"] = "parameter" if age is None else age
    for source in ("obstacles", "obstacle_states"):
        age = world.age(source, now_ns)
        if age is not None:
            values[f"age_s.{source}"] = age
    if mission.measured is not None:
        values["age_s.state"] = (now_ns - mission.measured.stamp_ns) * 1e-9
    for topic, count in sorted(rejections.counts.items()):
        values[f"rejected.{topic}"] = count
    stale, missing = world.stale(now_ns), world.missing
    if missing:
        return Health("inputs", Level.WARN, f"no direction of zone {', '.join(missing)}", values)
    if stale:
        message = f"{', '.join(stale)} not heard of for longer than its timeout: it grows"
        return Health("inputs", Level.WARN, message, values)
    return Health("inputs", Level.OK, "fresh", values)


def tracking_health(mission: Mission, now_ns: int) -> Health:
    """Distance between reference and measured attitude, and the measured one's clearance."""
    measured = mission.measured
    if measured is None:
        return Health("tracking", Level.OK, "no state has come", {})
    values: dict[str, object] = {}
    level, message = Level.OK, "within bounds"
    if mission.active and not mission.world.missing:
        rest = np.zeros(3)
        here = Setpoint(now_ns, measured.quaternion, rest, rest)
        margins = Judge(mission.world, mission.settings, now_ns).margins(here)
        for name, margin in margins.items():
            values[f"measured_clearance_deg.{name}"] = math.degrees(margin)
            if margin <= 0.0:
                level, message = Level.WARN, f"the measured attitude is inside {name}"
    reference = mission.timeline.at(measured.stamp_ns)
    if reference is not None:
        error = float(so3.quaternion_distance(reference.quaternion, measured.quaternion))
        values["error_rad"] = error
        values["bound_rad"] = mission.settings.tracking_bound
        if error > mission.settings.tracking_bound:
            level = Level.WARN
            message = f"{error:.4g} rad off the reference, more than tracking_bound"
    if (now_ns - measured.stamp_ns) * 1e-9 > mission.settings.input_timeout:
        level, message = Level.WARN, "the state is older than input_timeout"
    return Health("tracking", level, message, values)
