# SPDX-License-Identifier: Apache-2.0
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

from riem_planner.manifolds.lie_groups import CompactGroup, chain, skew_basis, special_orthogonal
from riem_planner.manifolds.matrices import (
    Array,
    Real,
    Span,
    adjoint,
    bracket,
    certain,
    logarithms_in,
    unitary_log,
)
from riem_planner.manifolds.matrix_space import MatrixSpace


class SymmetricSpace(MatrixSpace):
    """A symmetric space G/K of a compact group.

    Parameters
    ----------
    name
        What messages call it.
    group
        G; its metric, restricted to m, is that of the space.
    involution
        An automorphism of G with square 1; it acts on matrices, of the Lie algebra as well: k is
        where it is +1, m where it is -1.
    basis
        Basis of m to use for coordinates; by default one is made.
    connected
        Whether K is the identity component of the elements that the involution leaves fixed. By
        default K is all of them, which may identify points: `diag(-1, 1, 1)` on SO(3) gives RP^2
        with all of them, and S^2 with their identity component.

    Notes
    -----
    The logarithm comes from the Cartan embedding: for `h = exp(X) k` with X in m,
    `h involution(h)^-1 = exp(2 X)`. Any k that is left over is fixed by the involution; whether
    it is in the identity component is asked of its logarithm.
    """

    def __init__(
        self,
        name: str,
        group: CompactGroup,
        involution: Callable[[Array], Array],
        basis: Sequence[Array] | Array | None = None,
        *,
        connected: bool = False,
    ) -> None:
        self.group = group
        self.involution = involution
        self.connected = connected
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
        n = self.dimension
        self._curvature_bound = float(np.linalg.norm(self._curvature.reshape(n, n**3), 2))
        self._isotropy = Span([X + involution(X) for X in group.basis], group.scale)
        if not connected:
            self.remark = (
                f"a point of {name} is g K with all of K that the involution leaves fixed: g and"
                " g k are the same point for each such k (`connected=True` takes the identity"
                " component of K alone)"
            )

    @property
    def whole_algebra(self) -> Span:
        """The Lie algebra of G."""
        return self.group.span

    def embedded(self, h: Array) -> Array:
        """`h involution(h)^-1` (..., N, N), the same for all lifts of a point."""
        return np.asarray(h @ adjoint(self.involution(h)))

    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """Coordinates (..., n) of the shortest geodesic to h K, and whether it is determined."""
        v, determined = self.group.log_unchecked(self.embedded(h))
        v = 0.5 * self.coordinates(self.group.algebra(v))
        return self._connected(h, v, determined) if self.connected else (v, determined)

    def _connected(
        self, h: Array, v: Real, determined: NDArray[np.bool_]
    ) -> tuple[Real, NDArray[np.bool_]]:
        """The logarithms, longer ones where what is left of h is out of reach of K."""
        X, short = unitary_log(adjoint(self.exp(v)) @ h)
        good = determined & short & (self._isotropy.outside(X) < 1e-9)
        v, determined = np.array(v), np.array(determined)
        for index in map(tuple, np.argwhere(~good & np.isfinite(v).all(-1))):
            found = []
            for w, length in logarithms_in(self.span, self.embedded(h[index])):
                if self._in_isotropy(adjoint(self.exp(0.5 * w)) @ h[index]):
                    found.append((0.5 * w, 0.5 * length))
            v[index] = found[0][0] if found else np.nan
            determined[index] = certain(found)
        return v, determined

    def _in_isotropy(self, k: Array) -> bool:
        """Whether a matrix (N, N) is in the identity component of K."""
        fixed = bool(np.abs(k - self.involution(k)).max() < 1e-9)
        return fixed and bool(logarithms_in(self._isotropy, k))

    def gap(self, g: Array, h: Array) -> float:
        """Half the difference of the embedded points; infinite in another component of K."""
        difference = float(0.5 * np.linalg.norm(self.embedded(g) - self.embedded(h)))
        if self.connected and difference < 0.1:
            step = adjoint(h) @ g
            near = self.group.log_unchecked(self.embedded(step))[0]
            near = 0.5 * self.coordinates(self.group.algebra(near))
            if not self._in_isotropy(adjoint(self.exp(near)) @ step):
                return float(np.inf)
        return difference

    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """`-[v, [v', v]]`, coordinates (..., n)."""
        return np.asarray(-(self._triple(v, a, 2) @ v[..., None])[..., 0])

    def _triple(self, first: Real, second: Real, free: int) -> Real:
        """Matrix (..., n, n) of `[x, [y, z]]` by the vector in one of its places.

        Parameters
        ----------
        first, second : (..., n)
            The vectors in the other two places, in their order.
        free
            Which place it is: 0, 1 or 2.
        """
        n = self.dimension
        tensor = np.moveaxis(self._curvature, free, 2).reshape(n * n, n * n)
        pairs = (first[..., :, None] * second[..., None, :]).reshape(*first.shape[:-1], n * n)
        return np.swapaxes((pairs @ tensor).reshape(*first.shape[:-1], n, n), -1, -2)

    def curvature_bound(self, v: Real, a: Real, j: Real) -> Real:
        """Largest length (...) of `[v, [v', v]]`."""
        return np.asarray(self._curvature_bound * v * v * a)

    def curvature_operator(self, X: Real) -> Real:
        """`Y -> [X, [Y, X]]` (..., n, n)."""
        return self._triple(X, X, 1)

    def variation(self, w: Real, sigma: float, force: Real, bend: Real) -> Real:
        """Covariant rates: each gains `R(v, xi) w_k = [w_k, [v, xi]]`."""
        n = self.dimension
        v, a, j = w[..., 0, :], w[..., 1, :], w[..., 2, :]
        A = chain(w, sigma)
        for k, vector in enumerate((v, a, j), start=1):
            A[..., k * n : (k + 1) * n, :n] = self._triple(vector, v, 2)
        A[..., 3 * n :, :n] -= bend
        # The derivatives of -[v, [v', v]] by v, in both of its places, and by v'.
        A[..., 3 * n :, n : 2 * n] = -self._triple(a, v, 0) - self._triple(v, a, 2)
        A[..., 3 * n :, 2 * n : 3 * n] -= self._triple(v, v, 1)
        return A

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
            connected=True,
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

    def gap(self, g: Array, h: Array) -> float:
        """The chord between two points."""
        return float(np.linalg.norm(self.point(g) - self.point(h)))


def unit_sphere(n: int) -> UnitSphere:
    """S^n of radius 1."""
    return UnitSphere(n)


def real_grassmannian(p: int, n: int) -> SymmetricSpace:
    """Gr(p, n), the p-dimensional subspaces of R^n."""
    signs = np.where(np.arange(n) < p, 1.0, -1.0)
    m = [X for X in skew_basis(n) if np.any(signs[:, None] * X * signs != X)]
    space = SymmetricSpace(
        f"Gr({p}, {n})", special_orthogonal(n), lambda g: signs[:, None] * g * signs, m
    )
    space.remark = f"a point of {space.name} is a subspace, without orientation"
    return space
