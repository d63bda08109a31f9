"""How far a trajectory keeps from what is forbidden, at all times or at given ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.certificate.distance_bounds import bound_clearance
from riem_planner.obstacles import ObstacleTable, Zone, obstacle_table

if TYPE_CHECKING:
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
    worst
        Time [s] of the least distance found, per name.
    reasons
        What is entered, or can't be proven clear; empty when all is clear.
    """

    clearance: dict[str, float]
    worst: dict[str, float]
    reasons: tuple[str, ...]

    @property
    def certified(self) -> bool:
        """Whether every forbidden set is proven to be kept clear of."""
        return not self.reasons


def certify_clearance(
    trajectory: Trajectory,
    problem: Problem,
    *,
    from_time: float = 0.0,
    table: tuple[ObstacleTable, list[str]] | None = None,
) -> Clearance:
    """Bound a trajectory's distance to a problem's obstacles, from a given time on.

    Parameters
    ----------
    trajectory
        What is judged; it need not have been planned for this problem.
    problem
        Whose obstacles count; nothing else of it does.
    from_time
        Start of the part that is judged [s], in [0, duration]. The obstacles stand at their
        places of time 0 then, and move on from there.
    table
        `obstacle_table(problem)`, where it is at hand.

    Raises
    ------
    ValueError
        `from_time` is outside the trajectory.
    """
    if not 0.0 <= from_time <= trajectory.duration:
        raise ValueError(
            f"from_time must lie in [0, {trajectory.duration:.9g}] s, got {from_time:.9g}"
        )
    if problem.has_auto_duration:
        problem, table = replace(problem, duration=trajectory.duration), None
    rows, names = obstacle_table(problem) if table is None else table
    result = bound_clearance(
        trajectory.times,
        trajectory.quaternions_xyzw,
        trajectory.coefficients,
        float(from_time),
        (rows.kind, rows.place, rows.boresight, rows.rate, rows.radius, rows.group),
        problem.duration,
    ).tolist()
    clearance: dict[str, float] = {}
    worst: dict[str, float] = {}
    reasons = []
    for name, (bound, least, time) in zip(dict.fromkeys(names), result, strict=True):
        clearance[name], worst[name] = bound, time
        if not bound > 0.0:
            reasons.append(_reason(name, bound, least, time))
    return Clearance(clearance, worst, tuple(reasons))


def _reason(name: str, bound: float, least: float, time: float) -> str:
    if least <= 0.0:
        return f"{name}: enters the zone by {-least:.6g} rad at t = {time:.6g} s"
    return (
        f"{name}: no clearance can be proven (found {least:.3g} rad at t = {time:.6g} s, proven"
        f" {bound:.3g} rad)"
    )


def clearance_along(
    trajectory: Trajectory, problem: Problem, times: ArrayLike, *, from_time: float = 0.0
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
        Per obstacle's or keep-in group's name its margin (...) [rad], negative inside.
    """
    t = np.asarray(times, dtype=float)
    R, _, _ = trajectory.evaluate(t)
    margins: dict[str, Array] = {}
    for obstacle in problem.obstacles:
        margin = obstacle.distance(R, t - from_time) - obstacle.radius
        name = str(obstacle.name)
        if isinstance(obstacle, Zone) and obstacle.kind == "keep_in":
            name = obstacle.group if obstacle.group is not None else name
            margins[name] = np.maximum(margins.get(name, -np.inf), -margin)
        else:
            margins[name] = margin
    return margins
