# SPDX-License-Identifier: Apache-2.0
"""The slew matrix: least times and verdicts of any number of pairs, in bounded memory."""

from __future__ import annotations

import operator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import UNIT_TOLERANCE, non_negative_number
from riem_planner.errors import InvalidProblemError
from riem_planner.limits import Limits
from riem_planner.surveys.pairs import judge_pairs
from riem_planner.surveys.planned import planned_slew
from riem_planner.surveys.profiles import FASTEST, SMOOTH, Capacity
from riem_planner.surveys.slew import Slew, slew_of
from riem_planner.surveys.verdicts import SlewVerdict
from riem_planner.surveys.zone_array import ZoneArray, no_zones
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

_PROFILES = {"fastest": FASTEST, "smooth": SMOOTH}
_KEPT = ("rate", "acceleration", "torque", "momentum")
_CHUNK = 1 << 15  # pairs that are judged at once: a few megabytes


@dataclass(frozen=True, eq=False)
class SlewTimes:
    """Verdicts and times of many slews.

    Parameters
    ----------
    time : (...)
        Least duration [s]; infinite where there is no slew, NaN where an input is not finite.
    verdict : (...)
        `SlewVerdict`, as int8.
    straight_time : (...)
        Of the slew about the eigenaxis [s], whatever it crosses.
    settling_time
        What `settled` adds [s].
    """

    time: Array
    verdict: NDArray[np.int8]
    straight_time: Array
    settling_time: float
    _task: _Task = field(repr=False)

    @property
    def settled(self) -> Array:
        """Time (...) [s] until the spacecraft has settled, too."""
        return np.asarray(self.time + self.settling_time)

    def trajectory(self, index: Any) -> Slew | Trajectory:
        """The slew of one pair.

        It is computed anew, from the arrays that `slew_times` was given.

        Parameters
        ----------
        index
            Of the pair: a tuple of integers, one per dimension; of one dimension an integer.

        Returns
        -------
        Slew or Trajectory
            Both have `duration` and `evaluate(t)`: rotation matrices, body rates and body
            accelerations.

        Raises
        ------
        IndexError
            There is no such pair.
        ValueError
            The pair has no slew.
        """
        place = index if isinstance(index, tuple) else (index,)
        if len(place) != self.verdict.ndim:
            raise IndexError(f"expected {self.verdict.ndim} integers, one per dimension: {index!r}")
        place = tuple(operator.index(i) for i in place)
        verdict = SlewVerdict(int(self.verdict[place]))
        if not verdict.has_slew:
            raise ValueError(f"pair {index!r} has no slew: its verdict is {verdict.name}")
        shape = self.verdict.shape
        flat = 0
        for i, size in zip(place, shape, strict=True):
            flat = flat * size + i % size
        return self._task.slew(flat, float(self.time[place]))


def slew_times(
    start: ArrayLike,
    goal: ArrayLike,
    *,
    zones: ZoneArray | None = None,
    limits: Limits,
    settling_time: float = 0.0,
    profile: Literal["fastest", "smooth"] = "fastest",
    jobs: int = 1,
) -> SlewTimes:
    """Least durations of slews from rest to rest that keep clear of zones, each certified.

    Parameters
    ----------
    start, goal : (..., 4)
        Unit quaternions x, y, z, w, body to reference frame. Leading dimensions, those of the
        zones too, broadcast; an epoch is one more axis of all. NaN marks what is not known.
    zones
        What to keep out of; they stand still during a slew.
    limits
        What the spacecraft can do.
    settling_time
        [s]; only `settled` has it.
    profile
        `fastest`, whose acceleration jumps, or `smooth`: a polynomial whose acceleration is
        continuous and begins and ends with 0.
    jobs
        Threads.

    Returns
    -------
    SlewTimes
        Of the broadcast shape. The same whatever `jobs` is.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it. A value that is not finite is no error: its pairs
        are INVALID.
    """
    if not isinstance(limits, Limits):
        raise InvalidProblemError("limits", f"expected Limits, got {limits!r}")
    if profile not in _PROFILES:
        raise InvalidProblemError("profile", f"expected fastest or smooth, got {profile!r}")
    if jobs < 1:
        raise InvalidProblemError("jobs", f"expected at least 1, got {jobs}")
    settling_time = non_negative_number("settling_time", settling_time)
    task = _Task(start, goal, no_zones() if zones is None else zones, limits, profile)
    verdict = np.empty(task.shape, dtype=np.int8)
    time, straight = np.empty(task.shape), np.empty(task.shape)
    flat = (verdict.reshape(-1), time.reshape(-1), straight.reshape(-1))

    def judge(first: int) -> None:
        part = slice(first, min(first + _CHUNK, verdict.size))
        task.judge(part, tuple(array[part] for array in flat))

    firsts = range(0, verdict.size, _CHUNK)
    if jobs == 1:
        for first in firsts:
            judge(first)
    else:
        with ThreadPoolExecutor(jobs) as pool:
            for _ in pool.map(judge, firsts):
                pass
    return SlewTimes(time, verdict, straight, settling_time, task)


class _Task:
    """The inputs, checked, as compiled code takes them."""

    def __init__(
        self, start: ArrayLike, goal: ArrayLike, zones: ZoneArray, limits: Limits, profile: str
    ) -> None:
        if not isinstance(zones, ZoneArray):
            raise InvalidProblemError("zones", f"expected a ZoneArray, got {zones!r}")
        self.limits = limits
        self.capacity = capacity_of(limits)
        self.profile = _PROFILES[profile]
        self.boresights = np.array(zones.boresights)
        self.groups = zones.groups()
        ends = (_attitudes("start", start), _attitudes("goal", goal))
        table = zones.table()
        leads = (ends[0].shape[:-1], ends[1].shape[:-1], table.shape[:-2])
        try:
            self.shape = np.broadcast_shapes(*leads)
        except ValueError:
            raise InvalidProblemError(
                "zones", f"leading dimensions of start, goal and zones do not broadcast: {leads}"
            ) from None
        self._leads = leads
        self.starts, self.goals = (np.ascontiguousarray(end).reshape(-1, 4) for end in ends)
        self.zones = table.reshape(int(np.prod(table.shape[:-2])), len(zones.names), 5)
        self._finite = (
            _finite_rows("start", self.starts),
            _finite_rows("goal", self.goals),
            np.isfinite(self.zones).all(axis=(1, 2)),
        )

    def judge(self, part: slice, results: tuple[NDArray[Any], ...]) -> NDArray[np.float64]:
        """Fill verdicts, times and straight times of a part of the flat pairs; the paths."""
        rows = tuple(self._rows(i, part) for i in range(3))
        choices = np.empty((part.stop - part.start, 5))
        judge_pairs(
            (self.capacity, self.profile, self.boresights),
            self.groups,
            (self.starts, self.goals, self.zones, *self._finite),
            rows,
            results,
            choices,
        )
        verdicts, times, _ = results
        for i in np.flatnonzero(verdicts == SlewVerdict.NOT_FOUND):
            found = self._planned(*(int(row[i]) for row in rows))
            if found is not None:
                verdicts[i], times[i] = SlewVerdict.DETOUR, found.duration
        return choices

    def slew(self, flat: int, duration: float) -> Slew | Trajectory:
        """The slew of one of the flat pairs, which has one."""
        part = slice(flat, flat + 1)
        rows = tuple(int(self._rows(i, part)[0]) for i in range(3))
        results = (np.empty(1, dtype=np.int8), np.empty(1), np.empty(1))
        choices = np.empty((1, 5))
        judge_pairs(
            (self.capacity, self.profile, self.boresights),
            self.groups,
            (self.starts, self.goals, self.zones, *self._finite),
            tuple(np.array([row]) for row in rows),
            results,
            choices,
        )
        if results[0][0] == SlewVerdict.NOT_FOUND:
            found = self._planned(*rows)
            if found is None:
                raise ValueError("the arrays that slew_times was given have changed since")
            return found
        axis, (turn, roll) = choices[0, :3], (float(x) for x in choices[0, 3:])
        start = self.starts[rows[0]] / np.linalg.norm(self.starts[rows[0]])
        boresight = self.boresights[0] if len(self.boresights) else np.array([1.0, 0.0, 0.0])
        return slew_of(duration, start, (axis, turn, roll), boresight, self.capacity, self.profile)

    def _planned(self, start: int, goal: int, zone: int) -> Trajectory | None:
        return planned_slew(
            self.starts[start], self.goals[goal], self.zones[zone], self.boresights, self.limits
        )

    def _rows(self, which: int, part: slice) -> Rows:
        """Rows of one of the tables for a part of the flat pairs."""
        lead = self._leads[which]
        if lead == self.shape:
            return np.arange(part.start, part.stop)
        rows = np.arange(int(np.prod(lead))).reshape(lead)
        return np.asarray(np.broadcast_to(rows, self.shape).flat[part])


def capacity_of(limits: Limits) -> Capacity:
    """Limits as compiled code takes them.

    Raises
    ------
    InvalidProblemError
        There is one that no closed form here keeps.
    """
    for key in limits.keys:
        if key not in _KEPT:
            raise InvalidProblemError(
                f"limits.{key}", f"expected only {', '.join(_KEPT)}; plan such slews by solve"
            )
    reciprocals = np.zeros((4, 4))  # per quantity of the norm, then of each axis; 0: no limit
    for row, key in enumerate(_KEPT):
        value = getattr(limits, key)
        if value is not None:
            first = slice(0, 1) if isinstance(value, float) else slice(1, 4)
            reciprocals[row, first] = 1.0 / np.asarray(value)
    plain = not reciprocals[:2, 1:].any() and not reciprocals[2:].any()
    with np.errstate(divide="ignore"):
        rate, acceleration = (float(x) for x in 1.0 / reciprocals[:2, 0])
    return Capacity(
        plain, rate, acceleration, reciprocals, np.array(limits.inertia_matrix),
        limits.largest_moment,
    )  # fmt: skip


def _attitudes(key: str, value: ArrayLike) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidProblemError(key, "expected quaternions of shape (..., 4)") from None
    if array.ndim == 0 or array.shape[-1] != 4:
        raise InvalidProblemError(
            key, f"expected quaternions x, y, z, w of shape (..., 4), got shape {array.shape}"
        )
    return array


def _finite_rows(key: str, quaternions: Array) -> NDArray[np.bool_]:
    """Which quaternions (n, 4) are finite; those must be unit."""
    finite = np.empty(len(quaternions), dtype=bool)
    for first in range(0, len(quaternions), _CHUNK):
        part = slice(first, first + _CHUNK)
        q = quaternions[part]
        finite[part] = np.isfinite(q).all(axis=1)
        norms = np.linalg.norm(q, axis=1)
        off = finite[part] & (np.abs(norms - 1.0) > UNIT_TOLERANCE)
        if off.any():
            worst = int(np.flatnonzero(off)[0])
            raise InvalidProblemError(
                key,
                f"expected unit quaternions x, y, z, w, got {q[worst].tolist()} of norm"
                f" {norms[worst]:.6g}; normalise them",
            )
    return finite
