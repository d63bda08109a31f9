# SPDX-License-Identifier: Apache-2.0
"""A whole timeline: slews, waits and holds one after the other, each with its verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from riem_planner.errors import InvalidProblemError
from riem_planner.riem_timeline.inputs import Observations, SkyZone, Spacecraft
from riem_planner.riem_timeline.legs import Leg, Motion, clear, clearances, leg, rest
from riem_planner.surveys import SlewVerdict

ON_TIME = 0.010
"""An observation that starts no more than this after its time [s] is not late."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of the timeline.

    Parameters
    ----------
    kind
        `slew`, `wait` or `hold`.
    observation
        Row, from 0; a slew's and a wait's is that of what they lead to.
    start
        [s].
    motion
        What happens.
    margins
        Clearance from each zone [rad], certified where the segment is; infinite of no time.
    verdict
        Of a slew, in lower case.
    reason
        Why it is not certified; None where it is.
    late
        How much later than planned a hold starts [s].
    remedy
        What would help; empty if nothing was found, or nothing is wrong.
    """

    kind: str
    observation: int
    start: float
    motion: Motion
    margins: list[float]
    verdict: str | None = None
    reason: str | None = None
    late: float = 0.0
    remedy: str = field(default="")

    @property
    def duration(self) -> float:
        """[s]."""
        return self.motion.duration

    @property
    def end(self) -> float:
        """[s]."""
        return self.start + self.duration


def schedule(
    observations: Observations,
    spacecraft: Spacecraft,
    sky: Sequence[SkyZone],
    *,
    jobs: int = 1,
    progress: Callable[[], None] = lambda: None,
) -> list[Segment]:
    """The segments of a timeline, in time.

    Each slew begins when the observation before it has ended.

    Parameters
    ----------
    jobs
        Threads; they change nothing in the result.
    progress
        Called after every observation.

    Raises
    ------
    InvalidProblemError
        The sky does not cover the timeline.
    """
    check_cover(sky, float(observations.start[0]), float(observations.end[-1]))
    expected = observations.end

    def planned(i: int) -> Leg:
        a, b = observations.attitudes[i - 1 : i + 1]
        return leg(a, b, float(expected[i - 1]), spacecraft, sky)

    with ThreadPoolExecutor(jobs) as pool:
        count = len(expected)
        # As if nothing were late; where something is, the leg is done again.
        legs = pool.map(planned, range(1, count)) if jobs > 1 else map(planned, range(1, count))
        segments = [_hold(observations, 0, float(observations.start[0]), sky)]
        for i in range(1, count):
            end, slew = segments[-1].end, next(iter(legs))
            if end != expected[i - 1]:
                check_cover(sky, end, end + slew.motion.duration)
                a, b = observations.attitudes[i - 1 : i + 1]
                slew = leg(a, b, end, spacecraft, sky)
            segments += _approach(observations, i, end, slew, spacecraft, sky)
            progress()
    return segments


def _approach(
    observations: Observations,
    i: int,
    end: float,
    slew: Leg,
    spacecraft: Spacecraft,
    sky: Sequence[SkyZone],
) -> list[Segment]:
    """Slew, wait and hold of one observation, from the end of the one before."""
    verdict = slew.verdict.name.lower()
    certified = slew.verdict.has_slew
    first = Segment(
        "slew", i, end, slew.motion, slew.margins, verdict, None if certified else verdict
    )
    ready = first.end + spacecraft.settling_time
    begin = max(float(observations.start[i]), ready)
    check_cover(sky, end, max(begin, float(observations.end[i])))
    parts = [first]
    waiting = rest(observations.attitudes[i], begin - first.end)
    if waiting.pieces:
        margins = clearances(waiting, first.end, sky)
        reason = None if clear(margins) else "in_zone"
        parts.append(Segment("wait", i, first.end, waiting, margins, reason=reason))
    return [*parts, _hold(observations, i, begin, sky)]


def _hold(observations: Observations, i: int, begin: float, sky: Sequence[SkyZone]) -> Segment:
    motion = rest(observations.attitudes[i], float(observations.end[i]) - begin)
    late = max(0.0, begin - float(observations.start[i]))
    margins = clearances(motion, begin, sky)
    reason = None
    if not clear(margins):
        reason = "in_zone"
    elif late > ON_TIME:
        reason = "late"
    return Segment("hold", i, begin, motion, margins, reason=reason, late=late)


def check_cover(sky: Sequence[SkyZone], first: float, last: float) -> None:
    """Refuse a sky whose rows do not cover a time."""
    for zone in sky:
        if not zone.times[0] <= first <= last <= zone.times[-1]:
            raise InvalidProblemError(
                "sky: time_s",
                f"expected rows from {first:.6f} to {last:.6f} s at least, got"
                f" {zone.times[0]:.6f} to {zone.times[-1]:.6f} s; give more rows",
            )


def conflicts(segments: Sequence[Segment]) -> list[Segment]:
    """The segments that are not certified."""
    return [segment for segment in segments if segment.reason is not None]


def worst_degrees(segment: Segment) -> float:
    """Least clearance of a segment [deg]."""
    return float(np.degrees(min(segment.margins, default=np.inf)))


def is_detour(segment: Segment) -> bool:
    """Whether a segment is a certified detour."""
    return segment.verdict == SlewVerdict.DETOUR.name.lower()
