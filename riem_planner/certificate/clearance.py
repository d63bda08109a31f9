# SPDX-License-Identifier: Apache-2.0
"""How far a trajectory keeps from what is forbidden, at all times or at given ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.certificate.distance_bounds import bound_clearance
from riem_planner.obstacles import Forbidden
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Clearance:
    """Distances of a trajectory to what is forbidden, in continuous time.

    Parameters
    ----------
    clearance
        Certified lower bound of the distance [rad] to each forbidden set, by the obstacle's name
        or the keep-in group's.
    least_clearance_times
        Time [s] of the least distance found, per name.
    reasons
        What is entered, or can't be proven clear; empty when all is clear.
    """

    clearance: dict[str, float]
    least_clearance_times: dict[str, float]
    reasons: tuple[str, ...]

    @property
    def certified(self) -> bool:
        """Whether every forbidden set is proven to be kept clear of."""
        return not self.reasons


def certify_clearance(
    trajectory: Trajectory,
    where: Forbidden | Problem,
    *,
    from_time: float = 0.0,
) -> Clearance:
    """Bound a trajectory's distance to what is forbidden, from a given time on.

    Parameters
    ----------
    trajectory
        What is judged; it need not have been planned for these obstacles.
    where
        What to keep out of; of a problem only its obstacles count.
    from_time
        Start of the part that is judged [s], in [0, duration]. The obstacles stand at their
        places of time 0 then, and move on from there.

    Raises
    ------
    ValueError
        `from_time` is outside the trajectory.
    """
    if not 0.0 <= from_time <= trajectory.duration:
        raise ValueError(
            f"from_time must lie in [0, {trajectory.duration:.9g}] s, got {from_time:.9g}"
        )
    forbidden = where.forbidden if isinstance(where, Problem) else where
    result = bound_clearance(
        trajectory.times,
        trajectory.quaternions_xyzw,
        trajectory.coefficients,
        float(from_time),
        forbidden.table,
        _breaks(trajectory, forbidden, float(from_time)),
    ).tolist()
    clearance: dict[str, float] = {}
    worst: dict[str, float] = {}
    reasons = []
    for name, (bound, least, time) in zip(forbidden.names, result, strict=True):
        clearance[name], worst[name] = bound, time
        if not bound > 0.0:
            reasons.append(_reason(name, bound, least, time))
    return Clearance(clearance, worst, tuple(reasons))


def _breaks(trajectory: Trajectory, forbidden: Forbidden, from_time: float) -> Array:
    """Times (m,) between which neither the trajectory nor what is forbidden has a kink."""
    times = trajectory.times
    own = times.copy()
    if from_time > 0.0:
        own = np.concatenate([[from_time], times[times > from_time]])
    others = forbidden.breaks
    if not others.size:
        return own
    inside = others[(others > 0.0) & (others < trajectory.duration - from_time)] + from_time
    return np.union1d(own, inside)


def _reason(name: str, bound: float, least: float, time: float) -> str:
    if least <= 0.0:
        return f"{name}: enters the zone by {-least:.6g} rad at t = {time:.6g} s"
    return (
        f"{name}: no clearance can be proven (found {least:.3g} rad at t = {time:.6g} s, proven"
        f" {bound:.3g} rad)"
    )


def clearance_along(
    trajectory: Trajectory, where: Forbidden | Problem, times: ArrayLike, *, from_time: float = 0.0
) -> dict[str, Array]:
    """Distances of a trajectory to what is forbidden at given times, for plots and displays.

    Parameters
    ----------
    times : (...)
        Times in [0, duration] [s].
    from_time
        Time at which the obstacles stand at their places of time 0 [s].

    Returns
    -------
    dict
        Per forbidden set its margin (...) [rad], negative inside.
    """
    forbidden = where.forbidden if isinstance(where, Problem) else where
    t = np.asarray(times, dtype=float)
    return forbidden.margins(trajectory.evaluate(t)[0], t - from_time)
