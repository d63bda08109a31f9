# SPDX-License-Identifier: Apache-2.0
"""A problem on a compact Lie group, a symmetric space or R^n: frozen and validated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from riem_planner.checks import finite_array, finite_number, non_negative_number, positive_number
from riem_planner.errors import InvalidProblemError
from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.matrix_space import MatrixSpace
from riem_planner.manifolds.potentials import Barrier, Potential


@dataclass(frozen=True, eq=False)
class GeneralState:
    """A point and its rate.

    Parameters
    ----------
    element : (N, N)
        Group element; on a symmetric space any lift of the point.
    rate : (n,)
        v, coordinates of `g^-1 g'` in the basis of the space [1/s]; by default at rest. None
        leaves the rate free: the natural condition `v' = 0` takes its place.
    along : (p, n)
        Of the goal, on a group: directions of a subalgebra h; the end may be any element of
        `element exp(h)`. The natural condition is `sigma v - v''` orthogonal to h. By default the
        end is the element itself.
    """

    element: Array
    rate: Array | None = field(default_factory=lambda: np.zeros(0))
    along: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A point to pass at a given time, with the rate and acceleration that cost least.

    Parameters
    ----------
    element : (N, N)
        Group element; on a symmetric space any lift of the point.
    time
        When [s], between 0 and the duration.
    """

    element: Array
    time: float


@dataclass(frozen=True, eq=False)
class PointObstacle:
    """A point to keep away from, with the potential `tau / (d - r)^2` or another one.

    Parameters
    ----------
    element : (N, N)
        Group element; on a symmetric space any lift of the point.
    strength
        tau, in the metric of the space: lengths^4 / s^4. None where a potential is given.
    radius
        r, the distance never to fall below.
    name
        What results call it; by default its index in the problem.
    potential
        Another function of the distance, in place of the strength.
    rate : (k,)
        Of a moving obstacle: coordinates in the Lie algebra of the group that moves the space
        (`space.whole_algebra`) [1/s]; at time t it is at `exp(t rate) element`. By default at rest.
    """

    element: Array
    strength: float | None = None
    radius: float = 0.0
    name: str | None = None
    potential: Potential | None = None
    rate: Array | None = None


@dataclass(frozen=True, eq=False)
class GeneralProblem:
    """Minimise `1/2 int (|Dv/dt|^2 + sigma |v|^2 + sum V_i) dt` between two states.

    Parameters
    ----------
    space
        Where the curve lives.
    start, goal
        End states. On a symmetric space the goal's rate is taken along with its lift.
    duration
        T [s].
    tension
        sigma [1/s^2].
    obstacles
        What to keep away from.
    name
        What results call the problem.
    waypoints
        Points to pass on the way, in the order of their times.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    space: MatrixSpace
    start: GeneralState
    goal: GeneralState
    duration: float
    tension: float = 0.0
    obstacles: tuple[PointObstacle, ...] = field(default=())
    name: str = ""
    waypoints: tuple[Waypoint, ...] = field(default=())

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not isinstance(self.space, MatrixSpace):
            raise InvalidProblemError("space", f"expected a MatrixSpace, got {self.space!r}")
        put = object.__setattr__
        put(self, "duration", positive_number("duration", self.duration))
        put(self, "tension", non_negative_number("tension", self.tension))
        for key in ("start", "goal"):
            put(self, key, checked_state(self.space, key, getattr(self, key)))
        if len(self.start.along):
            raise InvalidProblemError("start.along", "expected a start that is one point")
        put(self, "obstacles", checked_obstacles(self.space, self.obstacles))
        put(self, "waypoints", self._checked_waypoints())

    def _checked_waypoints(self) -> tuple[Waypoint, ...]:
        checked: list[Waypoint] = []
        for i, waypoint in enumerate(self.waypoints):
            key = f"waypoints[{i}]"
            if not isinstance(waypoint, Waypoint):
                raise InvalidProblemError(
                    key, f"expected a Waypoint, got {type(waypoint).__name__}"
                )
            time = finite_number(f"{key}.time", waypoint.time)
            before = checked[-1].time if checked else 0.0
            if not before < time < self.duration:
                raise InvalidProblemError(
                    f"{key}.time",
                    f"expected a time after {before:.9g} s and before the end at"
                    f" {self.duration:.9g} s, got {time:.9g}",
                )
            checked.append(Waypoint(self.space.element(f"{key}.element", waypoint.element), time))
        return tuple(checked)

    def margins(self, element: Array, time: float = 0.0) -> dict[str, float]:
        """Distance of a point (N, N) to each obstacle's ball, by name; negative inside.

        Of a potential that excludes nothing, the distance to the point.
        """
        return {
            str(o.name): float(self.space.distance(element, place_at(self.space, o, time)))
            - shape_of(o).radius
            for o in self.obstacles
        }


def shape_of(obstacle: PointObstacle) -> Potential:
    """The potential of a validated obstacle."""
    if obstacle.potential is not None:
        return obstacle.potential
    assert obstacle.strength is not None
    return Barrier(obstacle.strength, obstacle.radius)


def place_at(space: MatrixSpace, obstacle: PointObstacle, time: Real | float) -> Array:
    """Where an obstacle is (..., N, N) at times (...) [s]."""
    if obstacle.rate is None:
        return obstacle.element
    turn = np.asarray(time)[..., None] * obstacle.rate
    return np.asarray(space.moved(turn, obstacle.element))


def checked_state(space: MatrixSpace, key: str, state: GeneralState) -> GeneralState:
    """The state with its element and rate validated and frozen."""
    if not isinstance(state, GeneralState):
        raise InvalidProblemError(key, f"expected a GeneralState, got {type(state).__name__}")
    n = space.dimension
    rate = state.rate
    if rate is not None:
        rate = finite_array(
            f"{key}.rate", np.zeros(n) if np.size(rate) == 0 else rate, (space.dimension,)
        )
    along = np.zeros((0, n))
    if np.size(state.along):
        along = finite_array(f"{key}.along", state.along, (len(state.along), n))
        along = _orthonormal_subalgebra(space, f"{key}.along", along)
    return replace(
        state, element=space.element(f"{key}.element", state.element), rate=rate, along=along
    )


def _orthonormal_subalgebra(space: MatrixSpace, key: str, along: Real) -> Real:
    """An orthonormal basis (p, n) of the span of directions, checked to be a subalgebra."""
    if space.frame_turn(space.identity) is not None:
        raise InvalidProblemError(
            key, f"expected a group, where an end may slide along a subgroup, got {space.name}"
        )
    _, sizes, rows = np.linalg.svd(along, full_matrices=False)
    basis = rows[sizes > 1e-9 * max(float(sizes[0]), 1e-300)]
    X = space.algebra(basis)
    brackets = space.coordinates(X[:, None] @ X[None] - X[None] @ X[:, None])
    if np.abs(brackets - brackets @ basis.T @ basis).max() > 1e-9:
        raise InvalidProblemError(
            key, "expected directions that span a subalgebra; their brackets leave the span"
        )
    return np.asarray(basis)


def checked_obstacles(
    space: MatrixSpace, obstacles: tuple[PointObstacle, ...]
) -> tuple[PointObstacle, ...]:
    """The obstacles, validated, each with a name."""
    checked = []
    for i, obstacle in enumerate(obstacles):
        key = f"obstacles[{i}]"
        if not isinstance(obstacle, PointObstacle):
            raise InvalidProblemError(
                key, f"expected a PointObstacle, got {type(obstacle).__name__}"
            )
        if (obstacle.strength is None) == (obstacle.potential is None):
            raise InvalidProblemError(
                f"{key}.strength", "expected exactly one of a strength and a potential"
            )
        shape = obstacle.potential
        if shape is None:
            shape_of(obstacle).check(key)
        elif isinstance(shape, Potential):
            shape.check(f"{key}.potential")
        else:
            raise InvalidProblemError(
                f"{key}.potential", f"expected a Potential, got {type(shape).__name__}"
            )
        rate = obstacle.rate
        if rate is not None:
            rate = finite_array(f"{key}.rate", rate, (space.whole_algebra.dimension,))
        checked.append(
            replace(
                obstacle,
                element=space.element(f"{key}.element", obstacle.element),
                name=str(i) if obstacle.name is None else obstacle.name,
                rate=rate if rate is not None and np.any(rate) else None,
            )
        )
    names = [o.name for o in checked]
    for name in names:
        if names.count(name) > 1:
            raise InvalidProblemError("obstacles", f"the name {name!r} is used twice")
    return tuple(checked)
