# SPDX-License-Identifier: Apache-2.0
"""What is forbidden: how far attitudes are from it, and how it repels.

A forbidden set has a name and members: it is kept clear of where at least one member is, and a
member where all its obstacles are. An obstacle by itself is a set of one member; a group is a set
whose zones are its members, those of one `member` together.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import frozen, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone, first_axis
from riem_planner.obstacles.repulsion import repulsion_of, united
from riem_planner.obstacles.table import Row, breaks, normalised, packed

Array = NDArray[np.float64]

Members = tuple[tuple[Obstacle, ...], ...]

_COVER = 1e-9  # of the last time, by which samples may miss it: rounding


@dataclass(frozen=True, eq=False)
class Forbidden:
    """Obstacles with their names and boresights, and the sets that they form.

    Parameters
    ----------
    obstacles
        What to keep away from, or inside of. One without a name is called by its index.
    boresight : (3,)
        Body axis of zones that name none.
    pointing
        Whether the space is S^2: zones then use its boresight, and attitudes are no obstacles.

    Raises
    ------
    InvalidProblemError
        An obstacle is none, or does not fit the space; or a name is used twice.
    """

    obstacles: tuple[Obstacle, ...] = ()
    boresight: Array = field(default_factory=first_axis)
    pointing: bool = False

    def __post_init__(self) -> None:
        """Validate, and give every obstacle its name and boresight."""
        object.__setattr__(self, "boresight", unit_vector("boresight", self.boresight))
        completed = tuple(self._completed(i, each) for i, each in enumerate(self.obstacles))
        object.__setattr__(self, "obstacles", completed)
        self._check_names()

    def _completed(self, index: int, obstacle: Obstacle) -> Obstacle:
        key = f"obstacles[{index}]"
        if not isinstance(obstacle, OrientationObstacle | Zone):
            raise InvalidProblemError(
                key, f"expected an OrientationObstacle or a Zone, got {type(obstacle).__name__}"
            )
        missing: dict[str, object] = {} if obstacle.name is not None else {"name": str(index)}
        if isinstance(obstacle, OrientationObstacle):
            if self.pointing:
                raise InvalidProblemError(
                    f"{key}.kind",
                    "an orientation obstacle would depend on the roll history on s2; give its"
                    " direction as a keep_out zone",
                )
        elif obstacle.boresight is None:
            missing["boresight"] = self.boresight
        elif self.pointing and not np.allclose(
            obstacle.boresight, self.boresight, rtol=0.0, atol=1e-9
        ):
            raise InvalidProblemError(
                f"{key}.boresight",
                f"on s2 an obstacle uses the space's boresight {self.boresight.tolist()}, got"
                f" {obstacle.boresight.tolist()}; leave it out, or plan on so3",
            )
        if not missing:
            return obstacle
        complete = copy.copy(obstacle)  # it has been checked already
        for name, value in missing.items():
            object.__setattr__(complete, name, value)
        return complete

    def _check_names(self) -> None:
        names = [obstacle.name for obstacle in self.obstacles]
        groups = {o.group for o in self.obstacles if isinstance(o, Zone) and o.group is not None}
        for name in [*names, *groups]:
            if [*names, *groups].count(name) > 1:
                raise InvalidProblemError(
                    "obstacles",
                    f"the name {name!r} is used twice; names of obstacles and groups must differ",
                )

    @cached_property
    def sets(self) -> dict[str, Members]:
        """Members of each forbidden set by its name: single obstacles first, then groups."""
        alone: dict[str, Members] = {}
        groups: dict[str, dict[object, list[Obstacle]]] = {}
        for index, obstacle in enumerate(self.obstacles):
            if obstacle.group is None:
                alone[str(obstacle.name)] = ((obstacle,),)
                continue
            member = index if obstacle.member is None else obstacle.member
            groups.setdefault(obstacle.group, {}).setdefault(member, []).append(obstacle)
        united = {
            name: tuple(tuple(member) for member in members.values())
            for name, members in groups.items()
        }
        return alone | united

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the forbidden sets, in the order of the table."""
        return tuple(self.sets)

    @cached_property
    def moving(self) -> bool:
        """Whether what is forbidden depends on time."""
        return any(obstacle.moves for obstacle in self.obstacles)

    @cached_property
    def fastest(self) -> float:
        """Upper bound of the rate of a margin at a fixed attitude, while all exist [rad/s]."""
        rates = [each.greatest_speed + each.greatest_growth for each in self.obstacles]
        return max(rates, default=0.0)

    @cached_property
    def known_until(self) -> float:
        """Time up to which the samples of all paths reach [s]; infinite without paths."""
        paths = [zone.path for zone in self.obstacles if isinstance(zone, Zone)]
        return min((path.end for path in paths if path is not None), default=np.inf)

    def check_covered(self, end: float) -> None:
        """Refuse paths whose samples do not cover all times from 0 to an end [s]."""
        for index, zone in enumerate(self.obstacles):
            path = zone.path if isinstance(zone, Zone) else None
            if path is None:
                continue
            key = f"obstacles[{index}].times"
            if path.start > 0.0:
                raise InvalidProblemError(key, f"begin at {path.start:g} s, after the start at 0 s")
            if path.end < end * (1.0 - _COVER):
                raise InvalidProblemError(
                    key, f"end at {path.end:g} s, before the arrival and hold at {end:g} s"
                )

    def margins(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> dict[str, Array]:
        """Distance [rad] to each forbidden set, negative inside, by its name.

        Parameters
        ----------
        attitudes : (..., 3, 3)
            Rotation matrices.
        times : (...)
            [s]; broadcast against the attitudes.

        Returns
        -------
        name -> (...)
            Of a set the best member counts, of a member the worst obstacle.
        """
        return {
            name: reduce(
                np.maximum,
                (
                    reduce(np.minimum, (each.margin(attitudes, times) for each in member))
                    for member in members
                ),
            )
            for name, members in self.sets.items()
        }

    def least_margin(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """The least of all margins (...) [rad]; infinite without obstacles."""
        shape = np.broadcast_shapes(np.shape(attitudes)[:-2], np.shape(times))
        margins = self.margins(attitudes, times).values()
        return reduce(np.minimum, margins, np.full(shape, np.inf))

    def repulsion(self, attitudes: Array, times: ArrayLike, duration: float) -> tuple[Array, Array]:
        """Sum of the potentials, and half its gradient, in plain NumPy.

        Parameters
        ----------
        attitudes : (n, 3, 3)
            Rotation matrices, body to reference frame.
        times : (n,)
            [s].
        duration
            T [s], which normalised strengths refer to.

        Returns
        -------
        potential : (n,)
            `sum V` [rad^2/s^4]; infinite in a forbidden set.
        force : (n, 3)
            `F = grad(sum V) / 2` in body components [rad/s^4]; not a number in a forbidden set.
        """
        t = np.broadcast_to(np.asarray(times, dtype=float), attitudes.shape[:1])
        V, F = np.zeros(t.size), np.zeros((t.size, 3))
        for members in self.sets.values():
            parts = []
            for member in members:
                each = [repulsion_of(o, o.strength_in(duration), attitudes, t) for o in member]
                potentials, forces = zip(*each, strict=True)
                parts.append((np.sum(potentials, axis=0), np.sum(forces, axis=0)))
            potential, force = united(parts)
            V, F = V + potential, F + force
        return V, F

    @cached_property
    def _rows(self) -> tuple[Row, ...]:
        """Obstacles in the order of the table, one for each window of time."""
        return tuple(
            Row(obstacle, window, number, m, number if len(members) > 1 else -1)
            for number, members in enumerate(self.sets.values())
            for m, member in enumerate(members)
            for obstacle in member
            for window in obstacle.windows
        )

    @cached_property
    def table(self) -> Array:
        """Rows (n, WIDTH) of all obstacles, set after set, in seconds and without strengths."""
        return frozen(packed(self._rows))

    @cached_property
    def breaks(self) -> Array:
        """Times (m,) [s] between which all that is forbidden moves smoothly."""
        return frozen(breaks(self.table))

    def normalised_table(self, duration: float) -> Array:
        """The table in units of a duration T [s], with strengths `tau T^4`."""
        strengths = [row.obstacle.normalized_in(duration) for row in self._rows]
        return normalised(self.table, strengths, duration)
