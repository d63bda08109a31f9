"""Riemannian symmetric spaces G/K by their Cartan decomposition: S^n and real Grassmannians.

A point is given by any lift g in G. Extremals satisfy
`v''' = sigma v' - [v, [v', v]] - F` in m (mathematics, section 3). Metrics:

============  =======================================================================
S^n           `1/2 tr(X^T Y)` on SO(n + 1)/SO(n): the unit sphere, point `g e_1`
Gr(p, n)      `1/2 tr(X^T Y)` on SO(n)/S(O(p) x O(n - p)): length = 2-norm of the
              principal angles, point = span of the first p columns of g
============  =======================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from riem_planner.manifolds.lie_groups import CompactGroup, skew_basis, special_orthogonal
from riem_planner.manifolds.matrix_space import (
    Array,
    MatrixSpace,
    Real,
    adjoint,
    bracket,
    unitary_log,
)


class SymmetricSpace(MatrixSpace):
    """A symmetric space G/K of a compact group.

    Parameters
    ----------
    name
        What messages call it.
    group
        G; its metric, restricted to m, is that of the space.
    involution
        The automorphism of G whose fixed elements have the identity component of K; it acts on
        matrices, of the Lie algebra as well: k is where it is +1, m where it is -1.
    basis
        Basis of m to use for coordinates; by default one is made.

    Notes
    -----
    The logarithm comes from the Cartan embedding: for `h = exp(X) k` with X in m,
    `h involution(h)^-1 = exp(2 X)`.
    """

    def __init__(
        self,
        name: str,
        group: CompactGroup,
        involution: Callable[[Array], Array],
        basis: Sequence[Array] | Array | None = None,
    ) -> None:
        self.group = group
        self.involution = involution
        if basis is None:
            basis = [X - involution(X) for X in group.basis]
        super().__init__(name, basis, group.scale)
        inner = bracket(self.basis[:, None], self.basis[None])
        if np.max(np.abs(self.coordinates(inner))) > 1e-9:
            raise ValueError(f"{name}: [m, m] is not in k; the involution is no automorphism")
        outer = bracket(self.basis[:, None, None], inner[None])
        self._curvature = self.coordinates(outer)
        if np.max(np.abs(self.algebra(self._curvature) - outer)) > 1e-9:
            raise ValueError(f"{name}: [m, [m, m]] is not in m; the involution is no automorphism")

    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """Coordinates (..., n) of the shortest geodesic to h K, and whether it is determined."""
        X, determined = unitary_log(h @ adjoint(self.involution(h)), traceless=self.group.traceless)
        return 0.5 * self.coordinates(X), determined

    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """`-[v, [v', v]]`, coordinates (..., n)."""
        term = np.einsum("...i,...j,...k,ijkl->...l", v, a, v, self._curvature, optimize=True)
        return np.asarray(-term)

    def in_frame(self, h: Array, w: Real) -> Real:
        """Part in m, coordinates (..., n), of `h w h^-1`."""
        return self.coordinates(h @ self.algebra(w) @ adjoint(h))

    def why_not_element(self, g: Array) -> str:
        """What keeps a matrix (N, N) from being in the group G."""
        return self.group.why_not_element(g)


class UnitSphere(SymmetricSpace):
    """S^n = SO(n + 1)/SO(n) of radius 1; the point of g is its first column.

    Parameters
    ----------
    dimension
        n. For n = 2 coordinates are the body rates about the second and third axis [rad/s].
    """

    def __init__(self, dimension: int) -> None:
        mirror = np.ones(dimension + 1)
        mirror[0] = -1.0
        basis = np.zeros((dimension, dimension + 1, dimension + 1))
        for i in range(dimension):
            basis[i, i + 1, 0], basis[i, 0, i + 1] = 1.0, -1.0
        if dimension == 2:
            basis = np.stack([-basis[1], basis[0]])  # hat(e_2), hat(e_3)
        super().__init__(
            f"S^{dimension}",
            special_orthogonal(dimension + 1),
            lambda g: mirror[:, None] * g * mirror,
            basis,
        )

    def point(self, g: Array) -> Real:
        """Unit vector (..., n + 1) of a lift (..., n + 1, n + 1)."""
        return np.asarray(g[..., :, 0])

    def lift(self, x: Array) -> Real:
        """The least rotation (n + 1, n + 1) from e_1 to a unit vector (n + 1,) other than -e_1."""
        total = np.eye(self.size)[0] + x
        if np.linalg.norm(total) < 1e-7:
            raise ValueError(f"{self.name}: e_1 and -e_1 have no least rotation; give a lift")
        half = total / np.linalg.norm(total)
        mirror = np.eye(self.size)
        mirror[0, 0] = -1.0
        # Two reflections: in e_1, and in the vector half-way.
        return np.asarray((2.0 * np.outer(half, half) - np.eye(self.size)) @ -mirror)

    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """As for `SymmetricSpace`, out to the antipode: the Cartan embedding covers S^n twice."""
        x = h[..., :, 0]
        sine = np.linalg.norm(x[..., 1:], axis=-1, keepdims=True)
        angle = np.arctan2(sine, x[..., :1])
        factor = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)
        tangent = factor * x[..., 1:]
        if self.dimension == 2:
            tangent = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        return tangent, (sine[..., 0] > 2e-7) | (x[..., 0] > 0.0)


def unit_sphere(n: int) -> UnitSphere:
    """S^n of radius 1."""
    return UnitSphere(n)


def real_grassmannian(p: int, n: int) -> SymmetricSpace:
    """Gr(p, n), the p-dimensional subspaces of R^n."""
    signs = np.where(np.arange(n) < p, 1.0, -1.0)
    m = [X for X in skew_basis(n) if np.any(signs[:, None] * X * signs != X)]
    return SymmetricSpace(
        f"Gr({p}, {n})", special_orthogonal(n), lambda g: signs[:, None] * g * signs, m
    )
