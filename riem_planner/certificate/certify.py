# SPDX-License-Identifier: Apache-2.0
"""The verdict on a published trajectory, with the numbers it rests on."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from riem_planner.certificate import curve
from riem_planner.certificate.after_arrival import with_hold
from riem_planner.certificate.clearance import certify_clearance
from riem_planner.certificate.extremality import extremality, invariant_drift
from riem_planner.certificate.limit_use import certify_limits
from riem_planner.certificate.tolerances import (
    ATTITUDE_TOLERANCE,
    DURATION_TOLERANCE,
    HALF_TURN,
    JOIN_TOLERANCE,
    JUMP_TOLERANCE,
    NORM_TOLERANCE,
    RATE_TOLERANCE,
)
from riem_planner.geometry import so3
from riem_planner.limits import Limits
from riem_planner.problem import LEAST_TIME, S2, Problem, State
from riem_planner.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Certificate:
    """Verdict of the checker on a published trajectory.

    Parameters
    ----------
    certified
        Whether everything below holds within tolerance.
    reasons
        Why not, with names and numbers; empty when certified.
    clearance
        Certified lower bound, in continuous time, of the distance to the forbidden set [rad],
        by the obstacle's name or the keep-in group's.
    least_clearance_times
        Time [s] of the least clearance found, per name.
    boundary_error
        Attitude (on S^2: direction) [rad] and rate [rad/s], the larger of start and goal.
    rate_bound
        Certified bound of `|v|` in continuous time [rad/s].
    limits_left
        Certified part of each limit that is left, at its worst in continuous time: 0.2 says that
        four fifths are used, -0.1 that a tenth more than allowed is. Empty without limits.
    breaks_only_limits
        Whether nothing but limits stands against the trajectory.
    trajectory, problem
        What was judged; the two figures below are computed from them when asked for.
    """

    certified: bool
    reasons: tuple[str, ...]
    clearance: dict[str, float]
    least_clearance_times: dict[str, float]
    boundary_error: tuple[float, float]
    rate_bound: float
    limits_left: dict[str, float]
    breaks_only_limits: bool
    trajectory: Trajectory = field(repr=False)
    problem: Problem = field(repr=False)

    @property
    def worst(self) -> dict[str, float]:
        """Old name of `least_clearance_times`."""
        _renamed("worst", "least_clearance_times")
        return self.least_clearance_times

    @property
    def limit_margins(self) -> dict[str, float]:
        """Old name of `limits_left`."""
        _renamed("limit_margins", "limits_left")
        return self.limits_left

    @cached_property
    def extremality(self) -> float:
        """Relative residual of the first-order conditions, integrated twice along the curve.

        Not a number where the curve is not proven to stay out of every zone: there the
        conditions do not hold, or mean nothing.
        """
        if not all(bound > 0.0 for bound in self.clearance.values()):
            return math.nan
        return extremality(self.trajectory, self.problem)

    @cached_property
    def invariant_drift(self) -> float | None:
        """Relative drift of the invariant H along the curve; None where obstacles move."""
        return invariant_drift(self.trajectory, self.problem)


def _renamed(old: str, new: str) -> None:
    message = f"Certificate.{old} is called {new} now; the old name goes with the next release"
    warnings.warn(message, DeprecationWarning, stacklevel=3)


def certify(
    trajectory: Trajectory,
    problem: Problem,
    limits: Limits | None = None,
    *,
    hold: Trajectory | None = None,
) -> Certificate:
    """Judge a published trajectory by itself: nothing of the solver is believed.

    Parameters
    ----------
    trajectory
        What setpoints are sampled from.
    problem
        What it has to fulfil; where its duration is automatic, that of the trajectory counts.
    limits
        What the spacecraft can do; by default the problem's.
    hold
        What follows the arrival, where the problem asks for a hold; by default the hold itself.
    """
    limited = problem.limits
    smooth = problem.objective == LEAST_TIME and limited is not None and limited.smooth
    if problem.has_auto_duration:
        problem = problem.timed(trajectory.duration, limited)
    start = problem.start
    goal = problem.arrival_near(so3.quaternion_to_matrix(trajectory.quaternions_xyzw[-1]))
    figures = curve.examine_curve(
        trajectory.times,
        trajectory.quaternions_xyzw,
        trajectory.angular_velocities,
        trajectory.angular_accelerations,
        trajectory.coefficients,
        (start.orientation, start.angular_velocity, goal.orientation, goal.angular_velocity),
        problem.boresight,
        problem.space == S2,
    ).tolist()
    cleared = certify_clearance(trajectory, problem.forbidden)
    cleared = with_hold(cleared, trajectory, problem, hold)
    within = certify_limits(
        trajectory, problem.limits if limits is None else limits, problem.total_momentum
    )
    reasons = _refusals(figures, trajectory, problem, goal) + cleared.reasons
    if smooth:
        reasons += _rough_ends(trajectory)
    return Certificate(
        certified=not reasons and not within.reasons,
        reasons=reasons + within.reasons,
        clearance=cleared.clearance,
        least_clearance_times=cleared.least_clearance_times,
        boundary_error=(
            max(figures[curve.START], figures[curve.GOAL]),
            max(figures[curve.START_RATE], figures[curve.GOAL_RATE]),
        ),
        rate_bound=figures[curve.RATE],
        limits_left={key: 1.0 - part for key, part in within.parts.items()},
        breaks_only_limits=bool(within.reasons) and not reasons,
        trajectory=trajectory,
        problem=problem,
    )


def _rough_ends(trajectory: Trajectory) -> tuple[str, ...]:
    """Sentences for accelerations at the ends, where limits of jerk ask for none."""
    a = np.linalg.norm(trajectory.angular_accelerations, axis=1)
    return tuple(
        f"{key}: an acceleration of {a[k]:.3g} rad/s^2, where a limit of jerk asks for none"
        for key, k in (("start", 0), ("goal", -1))
        if not a[k] <= RATE_TOLERANCE * np.max(a)
    )


def _refusals(
    figures: list[float], trajectory: Trajectory, problem: Problem, goal: State
) -> tuple[str, ...]:
    """Sentences for what is wrong with the curve itself."""
    if not figures[curve.FINITE]:
        return ("the trajectory has values that are not finite",)
    reasons = []
    duration, stated = trajectory.duration, problem.duration
    if not abs(duration - stated) <= DURATION_TOLERANCE * stated:
        reasons.append(f"duration: expected {stated:.9g} s, got {duration:.9g} s")
    if not figures[curve.NORM] <= NORM_TOLERANCE:
        reasons.append(f"quaternions: norms are off by up to {figures[curve.NORM]:.3g}")
    if not figures[curve.TURN] <= HALF_TURN:
        reasons.append(
            f"quaternions: turn by {figures[curve.TURN]:.6g} rad from the sample at"
            f" {figures[curve.TURN_TIME]:.6g} s to the next, more than {HALF_TURN:.4g}: a flipped"
            " sign, or too few samples"
        )
    elif not figures[curve.JOIN] <= JOIN_TOLERANCE:
        reasons.append(f"samples: intervals miss the next one by {figures[curve.JOIN]:.3g} rad")
    if not figures[curve.JUMP] <= JUMP_TOLERANCE:
        reasons.append(
            f"samples: the attitude jumps after {figures[curve.JUMP_TIME]:.6g} s: the rates do"
            " not account for its turn to the next sample"
        )
    for key, state, angle, rate in (
        ("start", problem.start, curve.START, curve.START_RATE),
        ("goal", goal, curve.GOAL, curve.GOAL_RATE),
    ):
        if not figures[angle] <= ATTITUDE_TOLERANCE:
            reasons.append(f"{key}: missed by {figures[angle]:.3g} rad")
        speed = math.hypot(*state.angular_velocity.tolist())
        if not stated * figures[rate] <= RATE_TOLERANCE * (1.0 + stated * speed):
            reasons.append(f"{key}: angular velocity missed by {figures[rate]:.3g} rad/s")
    if not figures[curve.ROLL] <= figures[curve.MOST_ROLL]:
        reasons.append(
            f"roll: up to {figures[curve.ROLL]:.3g} rad/s about the boresight after"
            f" {figures[curve.ROLL_TIME]:.6g} s, more than {figures[curve.MOST_ROLL]:.3g}"
        )
    return tuple(reasons)
