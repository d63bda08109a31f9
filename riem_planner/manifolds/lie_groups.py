# SPDX-License-Identifier: Apache-2.0
"""Compact Lie groups with a bi-invariant metric, and R^n.

Extremals satisfy `v''' = sigma v' - [v, v''] - F` (mathematics, section 3). Metrics:

========  =====================  ===================================================
SO(n)     `1/2 tr(X^T Y)`        SO(3): the rotation angle is the distance
SU(n)     `1/2 Re tr(X^* Y)`     SU(2): the unit sphere S^3, distance = half the angle
U(n)      `1/2 Re tr(X^* Y)`     U(1): a circle of radius sqrt(1/2)
R^n       the dot product
========  =====================  ===================================================

Another factor is given as `scale`: with `scale=2.0` SU(2) covers SO(3) isometrically.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.manifolds.matrices import (
    Array,
    Real,
    Span,
    bracket,
    certain,
    logarithms_in,
    unitary_log,
)
from riem_planner.manifolds.matrix_space import COTANGENT, MatrixSpace, series

_INSIDE = 1e-9  # largest element of a logarithm outside of the algebra that is rounding


class CompactGroup(MatrixSpace):
    """A compact matrix group with the bi-invariant metric `scale Re tr(X^* Y)`.

    Parameters
    ----------
    name
        What messages call it.
    basis : (n, N, N)
        Skew-Hermitian matrices that span its Lie algebra.
    scale
        Of the metric.
    traceless
        Whether the group is special unitary, where the shortest logarithm is one in su(N).
    equation
        Says what keeps a unitary matrix from being in the group, or nothing; by default it has
        to have a logarithm in the span of the basis.
    principal
        Whether the shortest logarithm of every element is known to lie in the algebra, as on
        SO(n), SU(n) and U(n). Otherwise each logarithm is checked, and another branch is looked
        for where it leaves the algebra.
    """

    def __init__(
        self,
        name: str,
        basis: Sequence[Array] | Array,
        scale: float = 0.5,
        *,
        traceless: bool = False,
        equation: Callable[[Array], str] | None = None,
        principal: bool = False,
    ) -> None:
        super().__init__(name, basis, scale)
        self.traceless = traceless
        self._equation = equation
        self._principal = principal
        brackets = bracket(self.basis[:, None], self.basis[None])
        self._structure = self.coordinates(brackets)
        if np.max(np.abs(self.algebra(self._structure) - brackets)) > 1e-9:
            raise ValueError(f"{name}: the basis does not span a Lie algebra")
        self._bracket_bound = float(np.linalg.norm(self._structure.reshape(self.dimension, -1), 2))

    @property
    def whole_algebra(self) -> Span:
        """The Lie algebra of the group."""
        return self.span

    def ad(self, X: Real) -> Real:
        """Matrix (..., n, n) of the bracket with X: `ad(X) @ Y = [X, Y]`."""
        n = self.dimension
        flat = X @ self._structure.reshape(n, n * n)
        return np.swapaxes(flat.reshape(*X.shape[:-1], n, n), -1, -2)

    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """Coordinates (..., n) of the shortest logarithm, and whether it is determined."""
        X, determined = unitary_log(h, traceless=self.traceless)
        v = self.coordinates(X)
        if self._principal:
            return v, determined
        good = determined & (np.abs(X - self.algebra(v)).max((-2, -1)) < _INSIDE)
        if good.all():
            return v, determined
        determined = np.array(determined)
        for index in map(tuple, np.argwhere(~good & np.isfinite(v).all(-1))):
            found = logarithms_in(self.span, h[index])
            v[index] = found[0][0] if found else np.nan
            determined[index] = certain(found)
        return v, determined

    def gap(self, g: Array, h: Array) -> float:
        """Length of `g - h`, by the norm of matrices."""
        return float(np.linalg.norm(g - h))

    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """`-[v, v'']`, coordinates (..., n)."""
        return np.asarray(-(self.ad(v) @ j[..., None])[..., 0])

    def curvature_bound(self, v: Real, a: Real, j: Real) -> Real:
        """Largest length (...) of `[v, v'']`."""
        return np.asarray(self._bracket_bound * v * j)

    def curvature_operator(self, X: Real) -> Real:
        """`-ad(X)^2 / 4` (..., n, n)."""
        ad = self.ad(X)
        return np.asarray(-0.25 * ad @ ad)

    def between_variation(self, X: Real) -> tuple[Real, Real, Real, Real]:
        """As on every space, but in left-invariant frames: `f(K) -/+ ad(X) / 2`."""
        ad = self.ad(X)
        f = series(COTANGENT, -0.25 * ad @ ad)
        own, other = 0.5 * ad - f, 0.5 * ad + f
        return own, other, own, other

    def variation(self, w: Real, sigma: float, force: Real, bend: Real) -> Real:
        """Rates of `(xi, v, v', v'')`: `xi' = dv - [v, xi]`, and the field's own."""
        n = self.dimension
        A = chain(w, sigma)
        A[..., :n, :n] = A[..., 3 * n :, 3 * n :] = -self.ad(w[..., 0, :])
        A[..., 3 * n :, :n] = -bend - 0.5 * self.ad(force)
        A[..., 3 * n :, n : 2 * n] = self.ad(w[..., 2, :])
        return A

    def frame_turn(self, h: Array) -> Real | None:
        """None: a group has one lift of each point."""
        return None

    def in_frame(self, h: Array, w: Real) -> Real:
        """The coordinates (..., n) themselves: a group has one lift of each point."""
        return w

    def why_not_element(self, g: Array) -> str:
        """What keeps a matrix (N, N) from being in the group."""
        reason = super().why_not_element(g)
        if reason:
            return reason
        if self._equation is not None:
            return self._equation(g)
        # The matrix itself may be off by rounding: its nearest unitary one is asked.
        left, _, right = np.linalg.svd(g)
        v, _ = self.log_unchecked(left @ right)
        return "" if np.isfinite(v).all() else "each logarithm of which leaves the Lie algebra"


def chain(w: Real, sigma: float) -> Real:
    """Rates (..., 4 n, 4 n) of the variations of `(x, v, v', v'')` in flat space, at w."""
    n = w.shape[-1]
    A = np.zeros((*w.shape[:-2], 4 * n, 4 * n))
    for k in range(3):
        A[..., k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    A[..., 3 * n :, 2 * n : 3 * n] = sigma * np.eye(n)
    return A


class EuclideanSpace(MatrixSpace):
    """R^n as the translations of itself, matrices [[I, p], [0, 1]].

    Parameters
    ----------
    dimension
        n.
    """

    def __init__(self, dimension: int) -> None:
        basis = np.zeros((dimension, dimension + 1, dimension + 1))
        for i in range(dimension):
            basis[i, i, dimension] = 1.0
        super().__init__(f"R^{dimension}", basis, 1.0)

    @property
    def whole_algebra(self) -> Span:
        """The translations."""
        return self.span

    def exp(self, v: Array) -> Array:
        """Translation (..., n + 1, n + 1) by a vector (..., n)."""
        return np.asarray(np.eye(self.size) + self.algebra(v))

    def moved(self, turn: Real, g: Array) -> Array:
        """The translation (..., n + 1, n + 1) after another one (..., n)."""
        return np.asarray(self.exp(turn) @ g)

    def inverse(self, g: Array) -> Array:
        """The opposite translation."""
        return np.asarray(2.0 * np.eye(self.size) - g)

    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """The vector (..., n) of a translation, which is always determined."""
        return h[..., :-1, -1], np.ones(h.shape[:-2], dtype=bool)

    def gap(self, g: Array, h: Array) -> float:
        """Length of `g - h`."""
        return float(np.linalg.norm(g - h))

    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """Zero: the space is flat."""
        return np.zeros_like(v)

    def curvature_bound(self, v: Real, a: Real, j: Real) -> Real:
        """Zero."""
        return np.zeros_like(v)

    def curvature_operator(self, X: Real) -> Real:
        """Zero (..., n, n)."""
        return np.zeros((*X.shape, self.dimension))

    def variation(self, w: Real, sigma: float, force: Real, bend: Real) -> Real:
        """Rates of the variations of `(p, v, v', v'')`."""
        A = chain(w, sigma)
        A[..., 3 * self.dimension :, : self.dimension] = -bend
        return A

    def frame_turn(self, h: Array) -> Real | None:
        """None: there is one lift of each point."""
        return None

    def in_frame(self, h: Array, w: Real) -> Real:
        """The coordinates (..., n) themselves."""
        return w

    def why_not_element(self, g: Array) -> str:
        """What keeps a matrix from being a translation."""
        expected = np.eye(self.size)
        expected[:-1, -1] = g[:-1, -1]
        return "that is not [[I, p], [0, 1]]" if np.max(np.abs(g - expected)) > 1e-6 else ""


def _determinant_one(g: Array) -> str:
    determinant = np.linalg.det(g)
    return "" if abs(determinant - 1.0) < 1e-6 else f"with determinant {determinant:.6g}"


def skew_basis(n: int) -> Real:
    """The matrices `e_i e_j^T - e_j e_i^T`, j < i, (n (n - 1) / 2, n, n)."""
    matrices = []
    for i in range(n):
        for j in range(i):
            X = np.zeros((n, n))
            X[i, j], X[j, i] = 1.0, -1.0
            matrices.append(X)
    return np.stack(matrices)


def special_orthogonal(n: int, scale: float = 0.5) -> CompactGroup:
    """SO(n). For n = 3 in the basis of `hat`, so that coordinates are body rates [rad/s]."""
    from riem_planner.geometry import so3

    basis: Any = so3.hat(np.eye(3)) if n == 3 else skew_basis(n)
    return CompactGroup(f"SO({n})", basis, scale, equation=_determinant_one, principal=True)


def _unitary_basis(n: int) -> list[Array]:
    symmetric = [1j * np.abs(X) for X in skew_basis(n)] if n > 1 else []
    skew = [X.astype(complex) for X in skew_basis(n)] if n > 1 else []
    diagonal = [np.diag(1j * row) for row in np.eye(n)]
    return [*skew, *symmetric, *diagonal]


def unitary(n: int, scale: float = 0.5) -> CompactGroup:
    """U(n)."""
    return CompactGroup(f"U({n})", _unitary_basis(n), scale, equation=lambda g: "", principal=True)


def special_unitary(n: int, scale: float = 0.5) -> CompactGroup:
    """SU(n). For n = 2 in the basis `-i sigma_k` of the Pauli matrices, multiplied like hats."""
    if n == 2:
        pauli = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])
        basis: Any = -1j * pauli
    else:
        basis = [X - np.trace(X) / n * np.eye(n) for X in _unitary_basis(n)]
    return CompactGroup(
        f"SU({n})", basis, scale, traceless=True, equation=_determinant_one, principal=True
    )


def euclidean(n: int) -> EuclideanSpace:
    """R^n; a point p is the translation `euclidean(n).exp(p)`."""
    return EuclideanSpace(n)
