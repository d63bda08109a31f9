# SPDX-License-Identifier: Apache-2.0
"""What is streamed when: trajectories spliced at integer nanoseconds, and the hold after them."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]


class Setpoint(NamedTuple):
    """The reference at one time.

    Attributes
    ----------
    stamp_ns : int
        [ns].
    quaternion : (4,)
        Unit, x, y, z, w, body to reference frame; its sign never flips.
    rate, acceleration : (3,)
        Body rate [rad/s] and body acceleration [rad/s^2].
    """

    stamp_ns: int
    quaternion: Array
    rate: Array
    acceleration: Array


class Purpose(Enum):
    """Why a segment is flown."""

    SLEW = "slewing"
    TRACK = "tracking"
    STOP = "stopping"
    WAY_OUT = "leaving a zone"


@dataclass(frozen=True, eq=False)
class Segment:
    """A trajectory with the time it begins at.

    Parameters
    ----------
    start_ns
        [ns].
    trajectory
        Flown from there, and held at its end.
    purpose
        Why.
    sign
        Of its quaternions as streamed, +1 or -1: the one that continues what was before.
    """

    start_ns: int
    trajectory: Trajectory
    purpose: Purpose
    sign: float = 1.0

    @property
    def end_ns(self) -> int:
        """When it has arrived [ns]."""
        return self.start_ns + round(self.trajectory.duration * 1e9)

    def elapsed(self, time_ns: int) -> float:
        """Time since its start [s], at most its duration."""
        return min(max((time_ns - self.start_ns) * 1e-9, 0.0), self.trajectory.duration)

    def at(self, time_ns: int) -> Setpoint:
        """The reference at a time from its start on; after its end, held at rest."""
        q, v, a = self.trajectory.evaluate_quaternion(self.elapsed(time_ns))
        if time_ns >= self.end_ns:
            return Setpoint(time_ns, self.sign * q, np.zeros(3), np.zeros(3))
        return Setpoint(time_ns, self.sign * q, v, a)


@dataclass(frozen=True)
class Timeline:
    """Segments in the order of their starts; immutable, so that any thread may read it.

    A segment is flown from its start to the start of the next one; the last one's end is held.
    """

    segments: tuple[Segment, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.segments)

    def segment_at(self, time_ns: int) -> Segment | None:
        """The segment that is flown at a time; None before the first."""
        for segment in reversed(self.segments):
            if segment.start_ns <= time_ns:
                return segment
        return None

    def at(self, time_ns: int) -> Setpoint | None:
        """The reference at a time; None before the first segment."""
        segment = self.segment_at(time_ns)
        return None if segment is None else segment.at(time_ns)

    def spliced(self, segment: Segment) -> Timeline:
        """The timeline that goes over to a segment at its start, whatever was to come then."""
        before = self.at(segment.start_ns)
        if before is not None:
            first = segment.trajectory.quaternions_xyzw[0]
            same = float(before.quaternion @ first) >= 0.0
            segment = replace(segment, sign=1.0 if same else -1.0)
        kept = tuple(old for old in self.segments if old.start_ns < segment.start_ns)
        return Timeline((*kept, segment))

    def pruned(self, now_ns: int) -> Timeline:
        """Without the segments that are over."""
        current = self.segment_at(now_ns)
        if current is None or current is self.segments[0]:
            return self
        return Timeline(self.segments[self.segments.index(current) :])

    def shifted(self, nanoseconds: int) -> Timeline:
        """The same motion, that much later."""
        return Timeline(
            tuple(replace(old, start_ns=old.start_ns + nanoseconds) for old in self.segments)
        )

    @property
    def last(self) -> Segment:
        """The segment whose end is held."""
        return self.segments[-1]

    @property
    def end_ns(self) -> int:
        """From when on the last attitude is held [ns]."""
        return self.last.end_ns

    def resting(self, time_ns: int) -> bool:
        """Whether the last attitude is held at a time."""
        return bool(self.segments) and time_ns >= self.end_ns


class Reference:
    """The timeline that is streamed, by one thread while others change it.

    However late a change comes, what is streamed goes on without a jump: a change of what has been
    streamed already is refused.

    Attributes
    ----------
    timeline
        Replaced as a whole.
    streamed_ns
        Up to when it has been streamed [ns].
    """

    def __init__(self) -> None:
        self.timeline = Timeline()
        self.streamed_ns = 0
        self._lock = threading.Lock()  # held for microseconds

    def stream(self, time_ns: int) -> Setpoint | None:
        """The reference at a time, which is streamed now; None before the first segment."""
        with self._lock:
            timeline, self.streamed_ns = self.timeline, time_ns
        return timeline.at(time_ns)

    def change(self, timeline: Timeline, from_ns: int) -> bool:
        """Take another timeline that differs from a time [ns] on; False if that comes too late."""
        with self._lock:
            late = bool(self.timeline) and self.streamed_ns > from_ns
            if not late:
                self.timeline = timeline
        return not late

    def prune(self, now_ns: int) -> None:
        """Forget the segments that are over."""
        with self._lock:
            self.timeline = self.timeline.pruned(now_ns)

    def shift(self, nanoseconds: int) -> None:
        """The same motion, that much later: the clock has jumped."""
        with self._lock:
            self.timeline = self.timeline.shifted(nanoseconds)
            self.streamed_ns += nanoseconds

    def end(self) -> None:
        """Stream nothing any more."""
        with self._lock:
            self.timeline = Timeline()
