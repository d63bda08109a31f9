# SPDX-License-Identifier: Apache-2.0
"""From a problem to the arrays of its transcription, and back to a trajectory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.least_time.model import ATTITUDE, IN, MIDDLE, OUT, Iterate, Model
from riem_planner.limit_rows import JERK, KEYS, MOMENTUM, POWERS, RATE, TORQUE_RATE, WHEEL_MOMENTUM
from riem_planner.obstacles import Obstacle, OrientationObstacle
from riem_planner.problem import S2, Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_MARGIN = 2e-4  # rad, from forbidden sets at the nodes: between them a path strays by less
_WEIGHT = 1e-8  # of changes of acceleration, beside the duration's part of 1
_NEVER = 2.0  # a cosine that nothing reaches
_INSTANT = 1e-3  # s, over which places are differentiated


@dataclass(frozen=True, eq=False)
class Frame:
    """A problem of least time in the solver's body axes, of which the first one points.

    Parameters
    ----------
    problem
        With limits.
    """

    problem: Problem

    @cached_property
    def axes(self) -> Array:
        """Matrix (3, 3) from the solver's body axes to the user's."""
        return np.eye(3) if self._pointed is None else so3.quaternion_to_matrix(self.turn)

    @cached_property
    def _pointed(self) -> Array | None:
        """The user's body axis (3,) that has to meet the goal; None if the whole attitude has."""
        return self.problem.boresight if self.problem.space == S2 else self.problem.roll_axis

    @cached_property
    def turn(self) -> Array:
        """The same as a quaternion (4,)."""
        if self._pointed is None:
            return np.array([0.0, 0.0, 0.0, 1.0])
        return so3.minimal_rotation(np.array([1.0, 0.0, 0.0]), self._pointed)

    @property
    def pointing(self) -> bool:
        """Whether only where the first axis points is given at the goal."""
        return self._pointed is not None

    @property
    def rolling(self) -> bool:
        """Whether the body may turn about its first axis on the way."""
        return self.problem.space != S2

    @cached_property
    def start(self) -> Array:
        """Quaternion (4,) of the start."""
        return so3.quaternion_multiply(self.problem.start.quaternion_xyzw, self.turn)

    @cached_property
    def goal(self) -> Array:
        """Quaternion (4,) of the goal; of a direction the one with the least turn to it."""
        if not self.pointing:
            return self.problem.arrival.quaternion_xyzw
        ahead = so3.quaternion_to_matrix(self.start).T @ self.direction
        turn = so3.minimal_rotation(np.array([1.0, 0.0, 0.0]), ahead)
        return so3.quaternion_multiply(self.start, turn)

    @cached_property
    def direction(self) -> Array:
        """Where the boresight points at the goal (3,), in the reference frame."""
        assert self._pointed is not None  # asked for only then
        return np.asarray(self.problem.arrival.orientation @ self._pointed)

    @cached_property
    def limits(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Norms, rows and first rows of the table of limits, in the solver's axes."""
        assert self.problem.limits is not None  # checked when the problem was made
        norms, rows, first = self.problem.limits.table
        return norms, rows @ self.axes, first

    @cached_property
    def power(self) -> float:
        """The greatest power of 1/T among the limited quantities."""
        norms, _, first = self.limits
        limited = [i for i in range(len(KEYS)) if norms[i] > 0.0 or first[i + 1] > first[i]]
        return max(POWERS[i] for i in limited)

    def slower(self, V: Array, A: Array, part: float) -> float:
        """Duration [s] in which a motion (n + 1, 3) of duration 1 uses at most a part of limits."""
        limits = self.problem.limits
        assert limits is not None
        v, a = V @ self.axes.T, A @ self.axes.T
        j = np.diff(a, axis=0, append=a[-1:]) * (len(a) - 1)
        parts = limits.parts(v, a, j)
        needed = (x ** (1.0 / of) for x, of in zip(parts / part, POWERS, strict=True) if x > 0.0)
        return max(needed, default=0.0)

    def model(self, intervals: int, duration: float, size: float, tightening: float) -> Model:
        """The transcription.

        Parameters
        ----------
        intervals
            N.
        duration
            T_0 [s], near the one looked for.
        size
            Of the slew [rad].
        tightening
            Part by which limits are taken smaller.
        """
        problem = self.problem
        slots, gains, rows, constraints = self._slots(duration, tightening)
        sets, place, drift, level, boresight = self._sets(intervals, duration, constraints)
        assert problem.limits is not None
        axes, pointing = self.axes, self.pointing
        goal_rate = problem.arrival.angular_velocity
        if pointing:
            goal = np.append(self.direction, 0.0)
            goal_rate = problem.arrival.orientation @ goal_rate
        else:
            goal, goal_rate = self.goal, axes.T @ goal_rate
        return Model(
            slots=slots,
            gains=gains,
            rows=rows,
            inertia=np.ascontiguousarray(axes.T @ problem.limits.inertia_matrix @ axes),
            momentum=problem.total_momentum * duration,
            power=self.power,
            sets=sets,
            place=place,
            drift=drift,
            level=level,
            boresight=boresight,
            ends=duration * np.array([axes.T @ problem.start.angular_velocity, goal_rate]),
            smooth=problem.limits.smooth,
            pointing=pointing,
            rolling=self.rolling,
            goal=goal,
            weight=_WEIGHT / size**2,
        )

    def _slots(
        self, duration: float, tightening: float
    ) -> tuple[NDArray[np.int64], Array, Array, int]:
        norms, rows, first = self.limits
        codes = [(i, i) for i in range(len(KEYS))] + [(i + MIDDLE, i) for i in (RATE, MOMENTUM)]
        if not np.any(self.problem.total_momentum):
            codes.append((WHEEL_MOMENTUM + MIDDLE, WHEEL_MOMENTUM))
        slots, gains, blocks, constraints = [], [], [np.zeros((0, 3))], 0
        for code, i in codes:
            scale = duration ** -POWERS[i] / (1.0 - tightening)
            begin = sum(len(block) for block in blocks)
            block = scale * rows[first[i] : first[i + 1]]
            if norms[i] > 0.0 or len(block):
                slots.append((code, int(POWERS[i]), begin, len(block), constraints))
                gains.append(scale * norms[i])
                blocks.append(block)
                constraints += max(1, 2 * len(block))
        return np.array(slots), np.array(gains), np.concatenate(blocks), constraints

    def _sets(
        self, intervals: int, duration: float, constraints: int
    ) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
        times = np.linspace(0.0, duration, intervals + 1)
        sets: list[tuple[int, int, int, int]] = []
        rows: list[tuple[Array, Array, Array, Array]] = []
        margins = self._margins()
        for name, members in self.problem.forbidden.sets.items():
            obstacles = [each for member in members for each in member if each.radius > 0.0]
            together = len(obstacles) if len(members) > 1 else 1
            for k in range(0, len(obstacles), together):
                some = obstacles[k : k + together]
                kind = {"orientation": ATTITUDE, "keep_out": OUT, "keep_in": IN}[some[0].kind]
                sets.append((kind, len(rows), together, constraints + len(sets)))
                rows += [self._member(each, times, margins[name]) for each in some]
        columns = zip(*rows, strict=True) if rows else ([], [], [], [])
        shapes = ((intervals + 1, 4), (intervals + 1, 4), (intervals + 1,), (3,))
        place, drift, level, boresight = (
            np.reshape(column, (len(rows), *shape))
            for column, shape in zip(columns, shapes, strict=True)
        )
        return np.array(sets, dtype=np.int64).reshape(-1, 4), place, drift, level, boresight

    def _margins(self) -> dict[str, float]:
        """Margins at the nodes [rad], less where an end has less."""
        problem = self.problem
        still = problem.forbidden.margins(problem.start.orientation, 0.0)
        if not problem.forbidden.moving and not self.pointing:
            at_goal = problem.forbidden.margins(problem.arrival.orientation, 0.0)
            still = {name: np.minimum(still[name], at_goal[name]) for name in still}
        return {name: min(_MARGIN, 0.5 * float(margin)) for name, margin in still.items()}

    def _member(
        self, obstacle: Obstacle, times: Array, margin: float
    ) -> tuple[Array, Array, Array, Array]:
        """Place and drift (n, 4), level (n,) and boresight (3,) of an obstacle."""
        if isinstance(obstacle, OrientationObstacle):
            place, after = (
                so3.matrix_to_quaternion(obstacle.orientation_at(times + dt))
                for dt in (0.0, _INSTANT)
            )
            after = after * np.sign(np.sum(place * after, axis=1))[:, None]
            level = np.full(times.size, math.cos(0.5 * (obstacle.radius + margin)) ** 2)
            drift = (after - place) / _INSTANT * times[:, None]
            return place, drift, level, np.zeros(3)
        place, after = np.zeros((2, times.size, 4))
        place[:, :3] = obstacle.direction_at(times)
        after[:, :3] = obstacle.direction_at(times + _INSTANT)
        radius = obstacle.radius + (margin if obstacle.kind == "keep_out" else -margin)
        level = np.full(times.size, math.cos(radius))
        drift = (after - place) / _INSTANT * times[:, None]
        return place, drift, level, self.axes.T @ obstacle.body_axis

    def trajectory(self, iterate: Iterate, duration: float) -> Trajectory:
        """The trajectory that an iterate means, in the user's axes."""
        q = so3.quaternion_multiply(iterate.q, so3.quaternion_conjugate(self.turn))
        q[0] = self.problem.start.quaternion_xyzw
        flips = np.sum(q[1:] * q[:-1], axis=1) < 0.0
        q[1:] *= np.cumprod(np.where(flips, -1.0, 1.0))[:, None]
        v, a = iterate.V @ self.axes.T / duration, iterate.A @ self.axes.T / duration**2
        return Trajectory(np.linspace(0.0, duration, len(q)), q, v, a)


def used_constraints(model: Model) -> NDArray[np.bool_]:
    """Which constraints there are, (N + 1, c).

    Rates at the ends are given, and with them what depends on rates alone; at the start, and at a
    given goal, so are attitudes.
    """
    n = model.level.shape[1] - 1
    last = [first + max(1, 2 * rows) for _, _, _, rows, first in model.slots]
    last += [constraint + 1 for *_, constraint in model.sets]
    used = np.zeros((n + 1, max(last)), dtype=np.bool_)
    for code, _, _, rows, first in model.slots:
        nodes = np.ones(n + 1, dtype=np.bool_)
        if code in (RATE, MOMENTUM, WHEEL_MOMENTUM):
            nodes[[0, n]] = False
        if code in (JERK, TORQUE_RATE) or code >= MIDDLE:
            nodes[n] = False
        used[:, first : first + max(1, 2 * rows)] = nodes[:, None]
    for _, member, members, constraint in model.sets:
        nodes = np.asarray(np.all(model.level[member : member + members] < _NEVER, axis=0))
        nodes[0] = False
        if not model.pointing:
            nodes[n] = False
        used[:, constraint] = nodes
    return used
