# SPDX-License-Identifier: Apache-2.0
"""Potential and force of a general problem's obstacles, batched, with derivatives."""

from __future__ import annotations

import numpy as np

from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.matrix_space import MatrixSpace, half_square_hessian
from riem_planner.manifolds.problem import PointObstacle, place_at, shape_of

_TINY = 1e-150


class Repulsion:
    """Potential and force of point obstacles at points g and times s.

    Parameters
    ----------
    space
        Where they are.
    obstacles
        Validated.
    scale
        Factor of every potential: `T^4` in normalised time.
    duration
        Of one unit of the times s [s]: T in normalised time.
    """

    def __init__(
        self,
        space: MatrixSpace,
        obstacles: tuple[PointObstacle, ...],
        scale: float = 1.0,
        duration: float = 1.0,
    ) -> None:
        self.space, self.obstacles, self.scale, self.duration = space, obstacles, scale, duration
        self.shapes = [shape_of(o) for o in obstacles]
        self.radii = np.array([shape.radius for shape in self.shapes])
        self.moves = any(o.rate is not None for o in obstacles)
        self._fixed = (
            np.stack([o.element for o in obstacles])
            if obstacles
            else np.zeros((0, space.size, space.size))
        )

    def __bool__(self) -> bool:
        return bool(self.obstacles)

    def places(self, s: Real | float) -> Array:
        """Where the m obstacles are (..., m, N, N) at times (...)."""
        if not self.moves:
            return self._fixed
        t = np.asarray(s) * self.duration
        shape = (*t.shape, self.space.size, self.space.size)
        return np.stack(
            [np.broadcast_to(place_at(self.space, o, t), shape) for o in self.obstacles], axis=-3
        )

    def distances(self, g: Array, s: Real | float) -> tuple[Real, Real]:
        """Distances (..., m) from points (..., N, N), and directions towards each (..., m, n)."""
        if not self.obstacles:
            return np.zeros((*g.shape[:-2], 0)), np.zeros((*g.shape[:-2], 0, self.space.dimension))
        logs = self.space.between(g[..., None, :, :], self.places(s))
        d = np.linalg.norm(logs, axis=-1)
        return d, logs / np.maximum(d, _TINY)[..., None]

    def potential(self, g: Array, s: Real | float = 0.0) -> Real:
        """`sum V` (...), infinite inside."""
        d, _ = self.distances(g, s)
        values = [shape.derivatives(d[..., i])[0] for i, shape in enumerate(self.shapes)]
        return np.asarray(self.scale * sum(values, np.zeros(d.shape[:-1])))

    def force(self, g: Array, s: Real | float = 0.0) -> Real:
        """`F` (..., n), half the gradient; not a number inside."""
        d, towards = self.distances(g, s)
        F = np.zeros((*g.shape[:-2], self.space.dimension))
        for i, shape in enumerate(self.shapes):
            slope = shape.derivatives(d[..., i])[1]
            F -= 0.5 * self.scale * slope[..., None] * towards[..., i, :]
        return F

    def force_and_bend(self, g: Array, s: Real | float) -> tuple[Real, Real]:
        """F (..., n), and its covariant derivative (..., n, n)."""
        d, towards = self.distances(g, s)
        n = self.space.dimension
        F, H = np.zeros((*g.shape[:-2], n)), np.zeros((*g.shape[:-2], n, n))
        if not self.obstacles:
            return F, H
        hessians = half_square_hessian(self.space.curvature_operator(d[..., None] * towards))
        for i, shape in enumerate(self.shapes):
            _, slope, bend = shape.derivatives(d[..., i])
            u = towards[..., i, :]
            along = u[..., :, None] * u[..., None, :]
            across = hessians[..., i, :, :] - along
            round_off = (slope / np.maximum(d[..., i], _TINY))[..., None, None]
            F -= 0.5 * self.scale * slope[..., None] * u
            H += 0.5 * self.scale * (bend[..., None, None] * along + round_off * across)
        return F, H

    def softened_roots(self, g: Array, s: Real, margin: float) -> tuple[Real, Real, Real]:
        """Square roots of the potentials (..., m), derivatives by own steps (..., m, n), distances.

        See `Potential.softened_root`.
        """
        d, towards = self.distances(g, s)
        pairs = [x.softened_root(d[..., i], margin) for i, x in enumerate(self.shapes)]
        size = np.sqrt(self.scale)
        roots = size * np.stack([root for root, _ in pairs], axis=-1)
        slopes = size * np.stack([slope for _, slope in pairs], axis=-1)
        return roots, -slopes[..., None] * towards, d
