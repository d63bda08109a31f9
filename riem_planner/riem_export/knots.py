# SPDX-License-Identifier: Apache-2.0
"""Attitudes for receivers that turn at a constant rate between records: as few as will do.

From a knot to the next one, h later, a turn about a fixed axis at a constant rate strays from the
attitude by at most `|a| h^2 / 8`. Knots are therefore spread with the density `sqrt(|a| / (8 e))`
for an error e; what results is measured, and they are made denser until it holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.files.plan_files import planned_trajectory, read_plan
from riem_planner.files.tables import names_of, read_table
from riem_planner.geometry import so3
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

TICK = 1e-6  # s; records stand at whole ticks
_WITHIN = 8  # points between two samples at which the density is taken
_SHARE = 0.8  # of the tolerance that is aimed at
_DENSER = 1.25
_TRIES = 40
_CHECKED = np.array([0.2, 0.4, 0.5, 0.6, 0.8])  # of the time between two knots
_WIDEST = 1.0  # rad between two knots


@dataclass(frozen=True, eq=False)
class Flight:
    """Trajectories one after the other, from time 0 on.

    Parameters
    ----------
    begins : (n,)
        Time of each [s].
    pieces
        The trajectories; where two meet the acceleration may jump.
    """

    begins: Array
    pieces: tuple[Trajectory, ...]

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.begins[-1] + self.pieces[-1].duration)

    def evaluate(self, times: Array) -> tuple[Array, Array, Array]:
        """Quaternions (n, 4), body rates (n, 3) and body accelerations (n, 3) at times (n,)."""
        which = np.clip(np.searchsorted(self.begins, times, side="right") - 1, 0, None)
        q, v, a = np.empty((times.size, 4)), np.empty((times.size, 3)), np.empty((times.size, 3))
        for k in np.unique(which):
            rows = which == k
            piece = self.pieces[k]
            local = np.clip(times[rows] - self.begins[k], 0.0, piece.duration)
            q[rows], v[rows], a[rows] = piece.evaluate_quaternion(local)
        return q, v, a


def read_flight(path: Path) -> Flight:
    """Flight of a plan file, or of a timeline's folder.

    Raises
    ------
    InvalidProblemError
        There is no trajectory in it; the error says why.
    """
    if path.is_dir():
        return _flight_of_rows(path / "reference.parquet")
    trajectory = planned_trajectory(read_plan(path))
    if trajectory is None:
        raise InvalidProblemError(str(path), "the plan holds no trajectory: nothing to export")
    return Flight(np.zeros(1), (trajectory,))


def _flight_of_rows(path: Path) -> Flight:
    if not path.exists():
        raise InvalidProblemError(str(path), "missing; riem_timeline writes it where it may")
    table = read_table(path)
    times = table.numbers("time_s")[:, 0]
    q, v, a = (
        table.numbers(*names_of(stem, parts))
        for stem, parts in (
            ("orientation", "xyzw"), ("angular_velocity", "xyz"), ("angular_acceleration", "xyz"),
        )
    )  # fmt: skip
    jumps = np.flatnonzero(np.diff(times) == 0.0) + 1
    ends = [0, *jumps, times.size]
    parts = [slice(first, last) for first, last in pairwise(ends)]
    return Flight(
        np.array([times[part][0] - times[0] for part in parts]),
        tuple(Trajectory(times[p] - times[p][0], q[p], v[p], a[p]) for p in parts),
    )


def knots(flight: Flight, tolerance: float, widest: float = _WIDEST) -> NDArray[np.int64]:
    """Times (n,) of records in ticks from the flight's begin, the first 0, the last its end.

    Parameters
    ----------
    tolerance
        Greatest error of the receiver's interpolation between them [rad].
    widest
        Most that the attitude may turn from one to the next [rad].

    Raises
    ------
    InvalidProblemError
        Ticks are too coarse for the tolerance.
    """
    grid, a, v = _grid(flight)
    density = np.maximum(np.sqrt(a / (8.0 * _SHARE * tolerance)), v / widest)
    for _ in range(_TRIES):
        count = np.concatenate([[0.0], np.cumsum(np.diff(grid) * density)])
        n = max(1, int(np.ceil(count[-1])))
        times = np.interp(np.linspace(0.0, count[-1], n + 1), count, grid)
        times[0], times[-1] = 0.0, flight.duration
        ticks = np.unique(np.round(times / TICK).astype(np.int64))
        if ticks.size < 2:
            ticks = np.array([0, max(1, round(flight.duration / TICK))])
        if greatest_error(flight, ticks) <= tolerance:
            return ticks
        density *= _DENSER
    raise InvalidProblemError(
        "--tolerance", f"expected one that records at microseconds can keep, got {tolerance:g}"
    )


def _grid(flight: Flight) -> tuple[Array, Array, Array]:
    """Times (n,), and the greatest |a| and |v| (n - 1,) between each and the next."""
    times, accelerations, rates = [np.zeros(1)], [], []
    share = np.arange(1, _WITHIN + 1) / _WITHIN
    for begin, piece in zip(flight.begins, flight.pieces, strict=True):
        steps = np.diff(piece.times)[:, None] * share
        inner = np.minimum((piece.times[:-1, None] + steps).ravel(), piece.duration)
        _, v, a = piece.evaluate_quaternion(np.concatenate([[0.0], inner]))
        size, speed = np.linalg.norm(a, axis=1), np.linalg.norm(v, axis=1)
        times.append(begin + inner)
        accelerations.append(np.maximum(size[1:], size[:-1]))
        rates.append(np.maximum(speed[1:], speed[:-1]))
    return np.concatenate(times), np.concatenate(accelerations), np.concatenate(rates)


def greatest_error(flight: Flight, ticks: NDArray[np.int64]) -> float:
    """Error of turns at a constant rate between records, the greatest found [rad]."""
    t = seconds(ticks)
    q = flight.evaluate(t)[0]
    turn = so3.quaternion_log(so3.quaternion_multiply(so3.quaternion_conjugate(q[:-1]), q[1:]))
    worst = 0.0
    for share in _CHECKED:
        shown = so3.quaternion_multiply(q[:-1], so3.quaternion_exp(share * turn))
        true = flight.evaluate(t[:-1] + share * np.diff(t))[0]
        worst = max(worst, float(np.max(so3.quaternion_distance(shown, true))))
    return worst


def seconds(ticks: NDArray[np.int64]) -> Array:
    """Times (n,) of ticks [s]."""
    return np.asarray(ticks * TICK, dtype=float)


def continuous(quaternions: Array) -> Array:
    """The same attitudes (n, 4) with signs that never jump."""
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    signs = np.cumprod(np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]))
    return np.asarray(signs[:, None] * quaternions)


def reference_rates(quaternions: Array, rates: Sequence[Array] | Array) -> Array:
    """Rates (n, 3) in the reference frame, of body rates (n, 3)."""
    matrices = so3.quaternion_to_matrix(quaternions)
    return np.asarray(np.einsum("nij,nj->ni", matrices, np.asarray(rates)))
