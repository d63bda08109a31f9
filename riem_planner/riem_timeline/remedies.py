# SPDX-License-Identifier: Apache-2.0
"""The nearest remedy of a conflict: another time, another roll, another order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.riem_timeline.inputs import Observations, SkyZone, Spacecraft
from riem_planner.riem_timeline.legs import clear, clearances, leg, rest
from riem_planner.riem_timeline.schedule import Segment

Array = NDArray[np.float64]

_ROLLS = np.radians([15 * sign * k for k in range(1, 13) for sign in (1, -1)])
_WAITS = 60.0 * np.array([1, 2, 5, 10, 20, 40, 60, 120, 240, 480, 720, 1440])  # s


def with_remedies(
    segments: Sequence[Segment],
    observations: Observations,
    spacecraft: Spacecraft,
    sky: Sequence[SkyZone],
    most: int,
) -> list[Segment]:
    """The segments, the first `most` conflicts with what would help."""
    told, left = [], most
    for segment in segments:
        if segment.reason is not None and left > 0:
            left -= 1
            words = _remedies(segment, observations, spacecraft, sky)
            segment = replace(segment, remedy="; or ".join(words))
        told.append(segment)
    return told


def _remedies(
    segment: Segment, observations: Observations, spacecraft: Spacecraft, sky: Sequence[SkyZone]
) -> list[str]:
    i = segment.observation
    if segment.reason == "late":
        return [f"end observation {i - 1} {segment.late:.3f} s earlier", *_order(i, observations)]
    if segment.kind == "slew":
        return _wait_for_slew(segment, observations, spacecraft, sky)
    attitude = observations.attitudes[i]
    return [
        *_roll(segment, attitude, spacecraft, sky),
        *_wait_for_hold(segment, attitude, sky),
    ] or _order(i, observations)


def _roll(
    segment: Segment, attitude: Array, spacecraft: Spacecraft, sky: Sequence[SkyZone]
) -> list[str]:
    """The least roll about the boresight at which an attitude keeps clear as long."""
    for angle in _ROLLS:
        turned = so3.quaternion_multiply(attitude, so3.quaternion_exp(angle * spacecraft.boresight))
        if clear(clearances(rest(turned, segment.duration), segment.start, sky)):
            return [f"roll by {np.degrees(angle):+.0f} deg about the boresight"]
    return []


def _wait_for_hold(segment: Segment, attitude: Array, sky: Sequence[SkyZone]) -> list[str]:
    """The least delay after which an attitude keeps clear as long."""
    for wait in _WAITS:
        start = segment.start + wait
        if start + segment.duration > min((zone.times[-1] for zone in sky), default=np.inf):
            break
        if clear(clearances(rest(attitude, segment.duration), start, sky)):
            return [f"observe it {wait / 60:.0f} min later"]
    return []


def _wait_for_slew(
    segment: Segment, observations: Observations, spacecraft: Spacecraft, sky: Sequence[SkyZone]
) -> list[str]:
    """The least delay after which a slew is certified."""
    i = segment.observation
    start, goal = observations.attitudes[i - 1 : i + 1]
    for wait in _WAITS:
        begin = segment.start + wait
        if begin + 2.0 * segment.duration > min((zone.times[-1] for zone in sky), default=np.inf):
            break
        if not clear(clearances(rest(start, wait), segment.start, sky)):
            break
        if leg(start, goal, begin, spacecraft, sky).verdict.has_slew:
            return [f"begin the slew {wait / 60:.0f} min later"]
    return _order(i, observations)


def _order(i: int, observations: Observations) -> list[str]:
    if i + 1 < len(observations.start):
        return [f"try observation {i + 1} before {i}"]
    return []
