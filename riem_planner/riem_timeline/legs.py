# SPDX-License-Identifier: Apache-2.0
"""One leg of a timeline: the slew between two attitudes, certified against the moving sky."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.certificate import certify_limits
from riem_planner.limit_rows import POWERS, QUANTITIES
from riem_planner.riem_timeline.inputs import SkyZone, Spacecraft
from riem_planner.surveys import Slew, SlewVerdict, ZoneArray, slew_times
from riem_planner.surveys.sky_clearance import sky_clearance
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES, _STRAIGHT_SAMPLES = 25, 4  # of a piece between two jumps of acceleration
_GROWTH = (1.0, 0.5, 0.2, 0.0)  # parts of a zone's motion that detours are searched beside
_WINDOW = 1.5  # straight times that a detour may take, when zones are first grown for it
_RIDING = 1e-9  # relative; a slew that rides a limit breaks it by rounding


@dataclass(frozen=True, eq=False)
class Motion:
    """Trajectories one after the other; where two meet the acceleration may jump."""

    pieces: tuple[Trajectory, ...]

    @property
    def duration(self) -> float:
        """[s]."""
        return float(sum(piece.duration for piece in self.pieces))

    def beginning_at(self, start: float) -> Iterator[tuple[float, Trajectory]]:
        """Each piece with its time [s]."""
        for piece in self.pieces:
            yield start, piece
            start += piece.duration

    def slowed(self, factor: float) -> Motion:
        """The same path in `factor` times the time."""
        return Motion(
            tuple(
                Trajectory(
                    factor * piece.times,
                    piece.quaternions_xyzw,
                    piece.angular_velocities / factor,
                    piece.angular_accelerations / factor**2,
                )
                for piece in self.pieces
            )
        )


def rest(attitude: Array, duration: float) -> Motion:
    """An attitude (4,) held; nothing where the duration is 0."""
    if duration <= 0.0:
        return Motion(())
    zero = np.zeros((2, 3))
    return Motion((Trajectory(np.array([0.0, duration]), np.tile(attitude, (2, 1)), zero, zero),))


def clearances(motion: Motion, start: float, sky: Sequence[SkyZone]) -> list[float]:
    """Certified lower bound of the clearance from each zone [rad]; found, where it is entered."""
    least = []
    for zone in sky:
        bounds = [
            sky_clearance(
                piece.times, piece.quaternions_xyzw, piece.coefficients, begin, zone.rows,
                zone.zone.boresight,
            )[0]
            for begin, piece in motion.beginning_at(start)
        ]  # fmt: skip
        least.append(float(min(bounds, default=np.inf)))
    return least


def clear(margins: Sequence[float]) -> bool:
    """Whether every zone is proven to be kept clear of."""
    return all(margin > 0.0 for margin in margins)


def inside(attitude: Array, time: float, sky: Sequence[SkyZone]) -> bool:
    """Whether an attitude is in some zone at a time, or on its edge."""
    return not clear(clearances(rest(attitude, 1e-6), time - 5e-7, sky))


@dataclass(frozen=True, eq=False)
class Leg:
    """A slew from one attitude to the next.

    Parameters
    ----------
    motion
        How it goes.
    verdict
        As the matrix calls it; certified if STRAIGHT or DETOUR.
    margins
        Clearance from each zone [rad], certified where the leg is.
    """

    motion: Motion
    verdict: SlewVerdict
    margins: list[float]


def leg(
    start: Array, goal: Array, begin: float, spacecraft: Spacecraft, sky: Sequence[SkyZone]
) -> Leg:
    """The quickest certified slew found from rest to rest at a time; else the straight one.

    Parameters
    ----------
    start, goal : (4,)
        Unit quaternions.
    begin
        Time of the sky [s].
    """
    result = slew_times(start, goal, limits=spacecraft.limits)
    straight = result.trajectory(())
    assert isinstance(straight, Slew)
    motion = Motion(tuple(straight.pieces(_STRAIGHT_SAMPLES)))
    margins = clearances(motion, begin, sky)
    direct = Leg(motion, SlewVerdict.STRAIGHT, margins)
    if clear(margins):
        return direct
    if inside(start, begin, sky):
        return replace(direct, verdict=SlewVerdict.START_IN_ZONE)
    found = _detour(start, goal, begin, spacecraft, sky, motion.duration)
    if found is not None:
        return found
    if inside(goal, begin + motion.duration, sky):
        return replace(direct, verdict=SlewVerdict.GOAL_IN_ZONE)
    window = (begin, begin + _WINDOW * motion.duration)
    still = slew_times(start, goal, zones=frozen_zones(sky, window, -1.0), limits=spacecraft.limits)
    sealed = still.verdict == SlewVerdict.SEALED
    return replace(direct, verdict=SlewVerdict.SEALED if sealed else SlewVerdict.NOT_FOUND)


def frozen_zones(sky: Sequence[SkyZone], window: tuple[float, float], growth: float) -> ZoneArray:
    """The zones half-way through a window of time, grown by a part of their motion in it."""
    first, last = (min(time, sky[0].times[-1]) for time in window)
    middle = np.array([0.5 * (first + last)])
    places = [zone.at(middle) for zone in sky]
    grown = [
        places[i][1][0] + growth * max(zone.motion(first, middle[0]), zone.motion(middle[0], last))
        for i, zone in enumerate(sky)
    ]
    return ZoneArray(
        tuple(zone.zone.name for zone in sky),
        np.array([zone.zone.boresight for zone in sky]),
        np.array([place[0][0] for place in places]),
        np.clip(grown, 0.0, np.pi * (1.0 - 1e-9)),
    )


def _detour(
    start: Array,
    goal: Array,
    begin: float,
    spacecraft: Spacecraft,
    sky: Sequence[SkyZone],
    straight: float,
) -> Leg | None:
    """A detour round zones that stand still, grown by less and less, that holds as they move."""
    for growth in _GROWTH:
        length = _WINDOW * straight
        for _ in range(2):
            zones = frozen_zones(sky, (begin, begin + length), growth)
            result = slew_times(start, goal, zones=zones, limits=spacecraft.limits)
            if result.verdict > SlewVerdict.DETOUR:
                break
            motion = within_limits(result.trajectory(()), spacecraft)
            if begin + motion.duration > sky[0].times[-1]:
                break
            margins = clearances(motion, begin, sky)
            if clear(margins):
                return Leg(motion, SlewVerdict.DETOUR, margins)
            length = motion.duration
    return None


def within_limits(slew: Slew | Trajectory, spacecraft: Spacecraft) -> Motion:
    """The trajectories of a slew, slowed if their samples use more than the limits allow."""
    if isinstance(slew, Trajectory):
        return Motion((slew,))
    motion = Motion(tuple(slew.pieces(_SAMPLES)))
    powers = dict(zip(QUANTITIES, POWERS, strict=False))
    factor = 1.0
    for piece in motion.pieces:
        for key, part in certify_limits(piece, spacecraft.limits).parts.items():
            factor = max(factor, part ** (1.0 / powers[key]))
    return motion if factor <= 1.0 + _RIDING else motion.slowed(factor)
