# SPDX-License-Identifier: Apache-2.0
"""The problem a user states: end states, duration, tension, obstacles. Frozen and validated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, non_negative_number, positive_number, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path
from riem_planner.goals.kinds import Goal, PointingGoal
from riem_planner.goals.state import HORIZONTAL_TOLERANCE, State, horizontal_rate
from riem_planner.limits import Limits
from riem_planner.obstacles import Forbidden, Obstacle

Array = NDArray[np.float64]

AUTO = "auto"
"""The duration that asks for the least within the limits."""

LEAST_ACCELERATION, LEAST_TIME = OBJECTIVES = ("least_acceleration", "least_time")
"""What is to be least."""

_BOUND_TIME = ("acceleration", "torque", "jerk", "torque_rate", "wheels")  # limits that do

DURATIONS = (1e-9, 1e12)
"""Least and greatest duration [s]; beyond, its powers leave the range of numbers."""

_COVER = 1e-9  # relative; a path that ends this much early covers the hold but for rounding

__all__ = ["AUTO", "DURATIONS", "S2", "SO3", "Problem", "Space", "State", "horizontal_rate"]


@dataclass(frozen=True)
class Space:
    """A space that trajectories live in, by its name in problem files."""

    name: str


SO3 = Space("so3")
"""Attitudes of a rigid body: the rotation group with its bi-invariant metric."""

S2 = Space("s2")
"""Pointing directions of a boresight: the unit sphere, lifted to attitudes that never roll."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise acceleration, tension and repulsion between two states.

    The cost is `1/2 int_0^T (|a|^2 + sigma |v|^2 + sum V_i) dt`.

    Parameters
    ----------
    start
        State at time 0.
    goal
        Where to arrive: a `State`, an `AttitudeGoal`, a `PointingGoal`, or a tuple of them, of
        which the cheapest to reach is chosen. On S^2 a `State`, of which only where the
        boresight points and how it moves is met; the rates of both ends must be orthogonal to
        the boresight.
    duration
        T [s]; `"auto"` for the least within the limits, which `solve` then finds (until then
        the duration is infinite).
    space
        `SO3` or `S2`.
    tension
        sigma [1/s^2]; or give `normalized_tension`, which is `sigma T^2`.
    obstacles
        What to keep away from or inside of.
    boresight : (3,)
        On S^2 the body axis that points; on SO(3) the axis of zones that name none.
    name
        What results call the problem.
    limits
        What the spacecraft can do; a trajectory is certified only within them.
    total_momentum : (3,)
        Angular momentum of body and wheels together, in the reference frame [N m s]; only the
        limits of wheels depend on it.
    hold
        For how long the attitude stays at the goal after the arrival [s], or goes on with it; on
        SO(3).
    objective
        `"least_acceleration"`, the cost above; or `"least_time"`, the least duration that any
        curve clear of the obstacles' radii needs within the limits. The duration is then
        automatic; strengths, ranges and tension play no part.
    notes
        Remarks on how the problem was stated, which its solution carries on.

    Attributes
    ----------
    forbidden
        What the obstacles forbid, and how they repel.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    start: State
    goal: Goal | tuple[Goal, ...]
    duration: float
    space: Space = SO3
    tension: float | None = None
    normalized_tension: float | None = None
    obstacles: tuple[Obstacle, ...] = ()
    boresight: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    name: str = ""
    limits: Limits | None = None
    total_momentum: Array = field(default_factory=lambda: np.zeros(3))
    hold: float = 0.0
    objective: str = LEAST_ACCELERATION
    notes: tuple[str, ...] = ()
    forbidden: Forbidden = field(init=False, repr=False)

    if TYPE_CHECKING:
        # What the constructor takes; the fields say what is kept of it.
        def __init__(
            self,
            start: State,
            goal: Goal | tuple[Goal, ...],
            duration: float | Literal["auto"],
            space: Space = ...,
            tension: float | None = None,
            normalized_tension: float | None = None,
            obstacles: Sequence[Obstacle] = (),
            boresight: ArrayLike = ...,
            name: str = "",
            limits: Limits | None = None,
            total_momentum: ArrayLike = ...,
            hold: float = 0.0,
            objective: str = ...,
            notes: tuple[str, ...] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        """Validate, freeze, and give every obstacle its name and boresight."""
        set_field = object.__setattr__
        if self.space not in (SO3, S2):
            raise InvalidProblemError("space", f"expected SO3 or S2, got {self.space!r}")
        if not isinstance(self.limits, Limits | None):
            raise InvalidProblemError("limits", f"expected Limits, got {self.limits!r}")
        set_field(self, "duration", self._checked_duration())
        self._check_objective()
        momentum = finite_array("total_momentum", self.total_momentum, (3,))
        if np.any(momentum) and (self.limits is None or not self.limits.wheels):
            raise InvalidProblemError(
                "total_momentum", "only limits of wheels depend on it: give limits.wheels"
            )
        set_field(self, "total_momentum", momentum)
        if self.tension is not None and self.normalized_tension is not None:
            raise InvalidProblemError(
                "tension", "expected at most one of tension, normalized_tension, got both"
            )
        for key in ("tension", "normalized_tension"):
            if getattr(self, key) is not None:
                set_field(self, key, non_negative_number(key, getattr(self, key)))
        set_field(self, "boresight", unit_vector("boresight", self.boresight))
        set_field(self, "hold", non_negative_number("hold", self.hold))
        forbidden = Forbidden(tuple(self.obstacles), self.boresight, self.space == S2)
        if not self.has_auto_duration:
            forbidden.check_covered(self.duration + self.hold)
        set_field(self, "forbidden", forbidden)
        set_field(self, "obstacles", forbidden.obstacles)
        if self.space == S2:
            self._check_horizontal("start", self.start)
        if not self.goals:
            raise InvalidProblemError("goal.any_of", "expected at least one goal")
        for i, goal in enumerate(self.goals):
            self._check_goal(f"goal.any_of[{i}]" if isinstance(self.goal, tuple) else "goal", goal)

    def _checked_duration(self) -> float:
        given: object = self.duration
        if given == math.inf and self.limits is not None:
            return math.inf
        if given != AUTO:
            number = positive_number("duration", given)
            least, most = DURATIONS
            if not least <= number <= most:
                raise InvalidProblemError(
                    "duration", f"expected from {least:g} to {most:g} s, got {number:g}"
                )
            return number
        if self.limits is None:
            raise InvalidProblemError(
                "limits", "missing; an automatic duration is the least within limits: give them"
            )
        return math.inf

    def _check_goal(self, key: str, goal: object) -> None:
        if not isinstance(goal, Goal):
            raise InvalidProblemError(
                key,
                f"expected a State, AttitudeGoal or PointingGoal, got {type(goal).__name__}",
            )
        if self.space == S2:
            if not isinstance(goal, State):
                raise InvalidProblemError(
                    key, f"{type(goal).__name__} needs space so3; on s2 give a State"
                )
            self._check_horizontal(key, goal)
        if not self.has_auto_duration:
            self._check_cover(key, goal)
        if self.hold > 0.0 and self.space == S2:
            raise InvalidProblemError("hold", "needs space so3; on s2 leave it out")
        if self.hold > 0.0 and isinstance(goal, State) and np.any(goal.angular_velocity):
            raise InvalidProblemError(
                "hold",
                f"{key} has an angular velocity, with which no attitude is held; give a goal with"
                " a rate, which the hold goes on with, or one at rest",
            )

    def _check_cover(self, key: str, goal: Goal) -> None:
        """Refuse paths that do not cover the arrival and the hold."""
        if not isinstance(goal, PointingGoal):
            return
        second = () if goal.second is None else ((f"{key}.second", goal.second[1]),)
        end = self.duration + self.hold
        for place, direction in ((key, goal.direction), *second):
            if not isinstance(direction, Path):
                continue
            if direction.end < end * (1.0 - _COVER):
                raise InvalidProblemError(
                    f"{place}.times",
                    f"end at {direction.end:.9g} s, before the arrival and hold at {end:.9g} s",
                )
            if direction.start > self.duration:
                raise InvalidProblemError(
                    f"{place}.times",
                    f"begin at {direction.start:.9g} s, after the arrival at {self.duration:.9g} s",
                )

    def _check_objective(self) -> None:
        if self.objective not in OBJECTIVES:
            raise InvalidProblemError(
                "objective", f"expected {' or '.join(OBJECTIVES)}, got {self.objective!r}"
            )
        if self.objective != LEAST_TIME:
            return
        if not self.has_auto_duration:
            raise InvalidProblemError(
                "duration",
                f"expected {AUTO}, got {self.duration:g}: objective {LEAST_TIME} finds the least;"
                f" give {AUTO}, or leave out the objective",
            )
        assert self.limits is not None  # an automatic duration has them
        if not any(key in self.limits.keys for key in _BOUND_TIME):
            raise InvalidProblemError(
                "limits.acceleration",
                f"missing; objective {LEAST_TIME} needs a limit that bounds time: of"
                f" {', '.join(_BOUND_TIME[:-1])} or {_BOUND_TIME[-1]}",
            )

    def _check_horizontal(self, key: str, state: State) -> None:
        roll = float(self.boresight @ state.angular_velocity)
        scale = max(1.0, float(np.linalg.norm(state.angular_velocity)))
        if abs(roll) > HORIZONTAL_TOLERANCE * scale:
            raise InvalidProblemError(
                f"{key}.angular_velocity",
                f"on s2 the rate must be orthogonal to the boresight, got a roll of {roll:.6g}"
                " rad/s; subtract it",
            )

    @property
    def goals(self) -> tuple[Goal, ...]:
        """The goals of which one is reached; mostly one alone."""
        return self.goal if isinstance(self.goal, tuple) else (self.goal,)

    def with_goal(self, index: int) -> Problem:
        """The problem with one of its goals alone."""
        return replace(self, goal=self.goals[index])

    @cached_property
    def arrival(self) -> State:
        """State at the arrival; where the roll is free, one of those allowed.

        Raises
        ------
        ValueError
            There are several goals: take one by `with_goal`. Or the goal moves, and the duration
            is yet to be found.
        """
        if len(self.goals) > 1:
            raise ValueError("the problem has several goals: take one by with_goal")
        goal = self.goals[0]
        if goal.moves and self.has_auto_duration:
            raise ValueError("where a moving goal is met is known once its duration is")
        return goal.arrival(self.duration if goal.moves else 0.0)

    @property
    def roll_axis(self) -> Array | None:
        """Body axis (3,) about which the attitude at the arrival is free; None where it is not."""
        return self.goals[0].roll_axis if len(self.goals) == 1 else None

    def goal_near(self, attitude: Array) -> int:
        """Index of the goal that an attitude (3, 3) at the arrival is nearest to."""
        states = [_nearest(goal, self.duration, attitude) for goal in self.goals]
        distances = [float(so3.distance(state.orientation, attitude)) for state in states]
        return distances.index(min(distances))

    def arrival_near(self, attitude: Array) -> State:
        """Of the states in which a slew may arrive the one nearest to an attitude (3, 3)."""
        return _nearest(self.goals[self.goal_near(attitude)], self.duration, attitude)

    def shown_arrival(self, end: Array | None = None) -> State:
        """A state at the arrival, for displays of a trajectory that ends in an attitude (3, 3).

        Without one, of the first goal; where the duration is yet to be found, at 1 s.
        """
        timed = replace(self, duration=1.0) if self.has_auto_duration else self
        if end is not None:
            return timed.arrival_near(end)
        return timed.goals[0].arrival(timed.duration)

    @property
    def has_auto_duration(self) -> bool:
        """Whether the duration is the least within the limits, yet to be found."""
        return math.isinf(self.duration)

    def timed(self, duration: float, limits: Limits | None = None) -> Problem:
        """The problem of least acceleration with the same ends and obstacles, a duration [s].

        Parameters
        ----------
        duration
            T [s].
        limits
            What it has to keep.
        """
        momentum = self.total_momentum if limits is not None else np.zeros(3)
        return replace(
            self, duration=duration, limits=limits, total_momentum=momentum,
            objective=LEAST_ACCELERATION,
        )  # fmt: skip

    @property
    def sigma(self) -> float:
        """Tension sigma [1/s^2]."""
        if self.normalized_tension is not None:
            return self.normalized_tension / self.duration**2
        return self.tension or 0.0

    def strength_of(self, obstacle: Obstacle) -> float:
        """Strength tau of an obstacle [rad^4/s^4]."""
        return obstacle.strength_in(self.duration)

    def margins(self, attitude: ArrayLike, time: float = 0.0) -> dict[str, float]:
        """Distance [rad] of an attitude (3, 3) to each forbidden set; negative inside.

        Keys are the obstacles' names and, for a keep-in group, the group's: there the margin
        is that of its best member.
        """
        margins = self.forbidden.margins(attitude, time)
        return {name: float(margin) for name, margin in margins.items()}


def _nearest(goal: Goal, time: float, attitude: Array) -> State:
    """Of the states that meet a goal at a time the one nearest to an attitude (3, 3)."""
    state = goal.arrival(time)
    if goal.roll_axis is None:
        return state
    x, y, z, w = so3.matrix_to_quaternion(state.orientation.T @ attitude)
    # The turn about b whose remainder is least: the twist of the relative quaternion.
    roll = 2.0 * math.atan2(float(goal.roll_axis @ (x, y, z)), w)
    turned = so3.exp(roll * goal.roll_axis)
    return State(state.orientation @ turned, turned.T @ state.angular_velocity)
