# SPDX-License-Identifier: Apache-2.0
"""Spaces given by matrices: what compact Lie groups and symmetric spaces have in common.

A curve in a symmetric space G/K is described by its horizontal lift g(t) in G, a curve with
`g^-1 g' = v` in m, where `Lie(G) = k + m`, `[k, m] < m`, `[m, m] < k`. A Lie group is the case
without K. Rates are coordinates (n,) in an orthonormal basis of m, so the metric is the dot
product; on matrices it is `<X, Y> = scale Re tr(X^* Y)`, with the scale stated by each space.

With `K_X Y = R(Y, X) X` the curvature along X = log(g^-1 h), positive semidefinite, the second
derivative of half the squared distance is `f(K_X)`, `f(k) = sqrt(k) cot(sqrt(k))`, and a step of
h moves X by `e(K_X)`, `e(k) = sqrt(k) / sin(sqrt(k))`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.errors import InvalidProblemError, RiemPlannerError
from riem_planner.manifolds.matrices import Array, Real, Span, adjoint, unitary_exp

COTANGENT = (1.0, -1 / 3, -1 / 45, -2 / 945, -1 / 4725, -2 / 93555)
"""Coefficients of `f`."""

COSECANT = (1.0, 1 / 6, 7 / 360, 31 / 15120, 127 / 604800, 73 / 3421440)
"""Coefficients of `e`."""

_ELEMENT_TOLERANCE = 1e-6


class OutsideInjectivityRadiusError(RiemPlannerError, ValueError):
    """The logarithm of an element is not determined: more than one shortest geodesic ends there.

    Parameters
    ----------
    space
        Name of the space.
    reason
        Where the element lies.
    """

    def __init__(self, space: str, reason: str) -> None:
        super().__init__(
            f"{space}: the logarithm is undefined, {reason}; choose a point inside the"
            " injectivity radius, or pass through one in between"
        )


def series(coefficients: Sequence[float], K: Real) -> Real:
    """A power series of symmetric matrices (..., n, n), shorter than 0.3."""
    identity = np.eye(K.shape[-1])
    result = coefficients[-1] * identity
    for c in coefficients[-2::-1]:
        result = result @ K + c * identity
    return np.asarray(result)


def half_square_hessian(K: Real) -> Real:
    """`f(K)` (..., n, n): second derivative of `d^2 / 2`, of the curvature K along the geodesic."""
    finite = np.isfinite(K).all(axis=(-2, -1), keepdims=True)
    values, vectors = np.linalg.eigh(K if finite.all() else np.where(finite, K, 0.0))
    root = np.sqrt(np.maximum(values, 1e-12))
    scaled = vectors * (root / np.tan(root))[..., None, :]
    return np.asarray(scaled @ np.swapaxes(vectors, -1, -2))


class MatrixSpace(ABC):
    """A compact Lie group or a symmetric space, or R^n, by its matrices.

    Parameters
    ----------
    name
        What messages call it.
    basis : (k, N, N)
        Matrices that span the tangent space m at the identity; made orthonormal.
    scale
        Of the metric `scale Re tr(X^* Y)`.
    """

    remark: str = ""
    """What a user should know about the points of the space; results repeat it."""

    def __init__(self, name: str, basis: Sequence[Array] | Array, scale: float) -> None:
        self.name = name
        self.scale = scale
        self.span = Span(basis, scale)
        self.basis = self.span.basis
        self.dimension, self.size = self.span.dimension, self.span.size

    def __repr__(self) -> str:
        return self.name

    @property
    def identity(self) -> Array:
        """The identity matrix (N, N) of the group."""
        return np.eye(self.size, dtype=self.basis.dtype)

    @property
    @abstractmethod
    def whole_algebra(self) -> Span:
        """The Lie algebra of the group that moves the space: of G for a quotient G/K."""

    def algebra(self, v: Array) -> Array:
        """Matrix (..., N, N) in m of coordinates (..., n)."""
        return self.span.matrices(v)

    def coordinates(self, X: Array) -> Real:
        """Coordinates (..., n) of the part in m of matrices (..., N, N)."""
        return self.span.coordinates(X)

    def inverse(self, g: Array) -> Array:
        """Inverse (..., N, N) of group elements."""
        return adjoint(g)

    def exp(self, v: Array) -> Array:
        """Group element (..., N, N) of coordinates (..., n): the geodesic with that rate."""
        return unitary_exp(self.algebra(v))

    def moved(self, turn: Real, g: Array) -> Array:
        """`exp(turn) g` (..., N, N) for coordinates (..., k) in the whole algebra."""
        return np.asarray(unitary_exp(self.whole_algebra.matrices(turn)) @ g)

    def log(self, h: Array) -> Real:
        """Coordinates (..., n) of the shortest geodesic from the base point to that of h.

        Raises
        ------
        OutsideInjectivityRadiusError
            It is not determined.
        """
        v, determined = self.log_unchecked(h)
        if not np.isfinite(v).all():
            raise OutsideInjectivityRadiusError(
                self.name, "no logarithm of the element was found in the Lie algebra"
            )
        if not np.all(determined):
            raise OutsideInjectivityRadiusError(
                self.name, "the element is on the cut locus of the identity"
            )
        return v

    def between(self, g: Array, h: Array) -> Real:
        """Coordinates (..., n) in the frame of g of the shortest geodesic from g to h.

        On the cut locus one of the shortest, to 1e-6; not a number where none was found.
        """
        step = self.inverse(g) @ h
        v, determined = self.log_unchecked(step)
        if not np.all(determined):
            aside = self.exp(np.linspace(0.6e-6, 1e-6, self.dimension))
            v = np.where(determined[..., None], v, self.log_unchecked(step @ aside)[0])
        return v

    def distance(self, g: Array, h: Array) -> Real:
        """Length (...) of the shortest geodesic from g to h."""
        return np.asarray(np.linalg.norm(self.between(g, h), axis=-1))

    def between_variation(self, X: Real) -> tuple[Real, Real, Real, Real]:
        """How the geodesic X (..., n) from g to h varies with its ends, short ones only.

        Returns
        -------
        own, other : (..., n, n)
            Change of X by a step of g, and by one of h turned into the frame of g.
        arriving_own, arriving_other : (..., n, n)
            The same of the geodesic as seen from h, all in the frame of g.
        """
        K = self.curvature_operator(X)
        f, e = series(COTANGENT, K), series(COSECANT, K)
        return -f, e, -e, f

    def frame_turn(self, h: Array) -> Real | None:
        """Matrix (..., n, n) of `in_frame` by h in K (..., N, N); None on a group: no turn."""
        return np.swapaxes(self.in_frame(h[..., None, :, :], np.eye(self.dimension)), -1, -2)

    def element(self, key: str, value: ArrayLike) -> Array:
        """A read-only copy of a group element (N, N), checked to be one.

        Raises
        ------
        InvalidProblemError
            It is not in the group; the message says why.
        """
        g = np.array(value, dtype=self.basis.dtype)
        if g.shape != (self.size, self.size) or not np.all(np.isfinite(g)):
            raise InvalidProblemError(
                key,
                f"expected an element of {self.name}, a finite {self.size}x{self.size} matrix,"
                f" got shape {g.shape}",
            )
        reason = self.why_not_element(g)
        if reason:
            raise InvalidProblemError(key, f"expected an element of {self.name}, got one {reason}")
        g.setflags(write=False)
        return g

    def why_not_element(self, g: Array) -> str:
        """What keeps a matrix (N, N) from being in the group; empty if it is in it."""
        error = float(np.max(np.abs(g @ adjoint(g) - np.eye(self.size))))
        return f"with |g g^* - I| = {error:.3g}" if error > _ELEMENT_TOLERANCE else ""

    @abstractmethod
    def log_unchecked(self, h: Array) -> tuple[Real, NDArray[np.bool_]]:
        """As `log`, with whether each is determined in place of the error."""

    @abstractmethod
    def gap(self, g: Array, h: Array) -> float:
        """How far two lifts (N, N) are from being the same point, between matrices."""

    @abstractmethod
    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """What the space adds to `v''' = sigma v' - F`, coordinates (..., n)."""

    @abstractmethod
    def curvature_bound(self, v: Real, a: Real, j: Real) -> Real:
        """Largest length (...) of `curvature_term`, for vectors of lengths v, a, j (...)."""

    @abstractmethod
    def curvature_operator(self, X: Real) -> Real:
        """`K_X` (..., n, n), `K_X Y = R(Y, X) X`, of coordinates (..., n)."""

    @abstractmethod
    def variation(self, w: Real, sigma: float, force: Real, bend: Real) -> Real:
        """The extremal field, linearised.

        Parameters
        ----------
        w : (..., 3, n)
            v, v', v''.
        sigma
            Tension.
        force, bend : (..., n), (..., n, n)
            F and its covariant derivative.

        Returns
        -------
        (..., 4 n, 4 n)
            Rates of the variations of place, v, v', v'' by these variations; on a quotient the
            covariant ones.
        """

    @abstractmethod
    def in_frame(self, h: Array, w: Real) -> Real:
        """Coordinates (..., n) of a vector after a change of lift by h in K.

        A vector with coordinates w in the frame of `g h` has these in the frame of g.
        """
