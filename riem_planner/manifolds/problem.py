"""A problem on a compact Lie group, a symmetric space or R^n: frozen and validated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import (
    finite_array,
    non_negative_number,
    positive_number,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.manifolds.matrices import Real
from riem_planner.manifolds.matrix_space import MatrixSpace

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class GeneralState:
    """A point and its rate.

    Parameters
    ----------
    element : (N, N)
        Group element; on a symmetric space any lift of the point.
    rate : (n,)
        v, coordinates of `g^-1 g'` in the basis of the space [1/s]; by default at rest.
    """

    element: Array
    rate: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class PointObstacle:
    """A point to keep away from, with the potential `tau / (d - r)^2`.

    Parameters
    ----------
    element : (N, N)
        Group element; on a symmetric space any lift of the point.
    strength
        tau, in the metric of the space: lengths^4 / s^4.
    radius
        r, the distance never to fall below.
    name
        What results call it; by default its index in the problem.
    """

    element: Array
    strength: float
    radius: float = 0.0
    name: str | None = None


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

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not isinstance(self.space, MatrixSpace):
            raise InvalidProblemError("space", f"expected a MatrixSpace, got {self.space!r}")
        put = object.__setattr__
        put(self, "duration", positive_number("duration", self.duration))
        put(self, "tension", non_negative_number("tension", self.tension))
        for key in ("start", "goal"):
            put(self, key, checked_state(self.space, key, getattr(self, key)))
        put(self, "obstacles", checked_obstacles(self.space, self.obstacles))

    def margins(self, element: Array) -> dict[str, float]:
        """Distance of a point (N, N) to each obstacle's ball, by name; negative inside."""
        return {
            str(o.name): float(self.space.distance(element, o.element)) - o.radius
            for o in self.obstacles
        }


def checked_state(space: MatrixSpace, key: str, state: GeneralState) -> GeneralState:
    """The state with its element and rate validated and frozen."""
    if not isinstance(state, GeneralState):
        raise InvalidProblemError(key, f"expected a GeneralState, got {type(state).__name__}")
    rate = np.zeros(space.dimension) if np.size(state.rate) == 0 else state.rate
    return replace(
        state,
        element=space.element(f"{key}.element", state.element),
        rate=finite_array(f"{key}.rate", rate, (space.dimension,)),
    )


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
        checked.append(
            PointObstacle(
                space.element(f"{key}.element", obstacle.element),
                positive_number(f"{key}.strength", obstacle.strength),
                non_negative_number(f"{key}.radius", obstacle.radius),
                str(i) if obstacle.name is None else obstacle.name,
            )
        )
    names = [o.name for o in checked]
    for name in names:
        if names.count(name) > 1:
            raise InvalidProblemError("obstacles", f"the name {name!r} is used twice")
    return tuple(checked)


class Repulsion:
    """Potential and force of fixed point obstacles, batched.

    Parameters
    ----------
    space
        Where they are.
    obstacles
        Validated.
    scale
        Factor of every strength: `T^4` in normalised time.
    """

    def __init__(
        self, space: MatrixSpace, obstacles: tuple[PointObstacle, ...], scale: float = 1.0
    ) -> None:
        self.space = space
        self.elements = [o.element for o in obstacles]
        self.strengths = np.array([scale * o.strength for o in obstacles])
        self.radii = np.array([o.radius for o in obstacles])

    def distances(self, g: Array) -> tuple[Real, list[Real]]:
        """Distances (..., m) to m obstacles, and the logarithms (..., n) towards each."""
        logs = [self.space.between(g, q) for q in self.elements]
        if not logs:
            return np.zeros((*g.shape[:-2], 0)), logs
        return np.stack([np.linalg.norm(x, axis=-1) for x in logs], axis=-1), logs

    def potential(self, g: Array) -> Real:
        """`sum tau / (d - r)^2` (...), infinite inside."""
        d, _ = self.distances(g)
        margin = d - self.radii
        with np.errstate(divide="ignore"):
            V = np.where(margin > 0.0, self.strengths / margin**2, np.inf)
        return np.asarray(np.sum(V, axis=-1))

    def force(self, g: Array) -> Real:
        """`F = sum tau log(g^-1 q) / (d (d - r)^3)` (..., n), half the gradient."""
        d, logs = self.distances(g)
        F = np.zeros((*g.shape[:-2], self.space.dimension))
        for i, towards in enumerate(logs):
            margin = d[..., i] - self.radii[i]
            safe = np.where(margin > 0.0, d[..., i] * margin**3, np.nan)
            F += (self.strengths[i] / safe)[..., None] * towards
        return F
