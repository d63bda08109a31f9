"""Spaces given by matrices: what compact Lie groups and symmetric spaces have in common.

A curve in a symmetric space G/K is described by its horizontal lift g(t) in G, a curve with
`g^-1 g' = v` in m, where `Lie(G) = k + m`, `[k, m] < m`, `[m, m] < k`. A Lie group is the case
without K. Rates are coordinates (n,) in an orthonormal basis of m, so the metric is the dot
product; on matrices it is `<X, Y> = scale Re tr(X^* Y)`, with the scale stated by each space.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.errors import InvalidProblemError, RiemPlannerError

Array = NDArray[Any]
Real = NDArray[np.float64]

_ELEMENT_TOLERANCE = 1e-6
_NEAR_HALF_TURN = 1e7  # tan(angle / 2) of an eigenvalue 2e-7 rad from -1


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


def bracket(X: Array, Y: Array) -> Array:
    """Commutator `X Y - Y X` (..., N, N)."""
    return np.asarray(X @ Y - Y @ X)


def adjoint(X: Array) -> Array:
    """Conjugate transpose (..., N, N), the inverse of a unitary matrix."""
    return np.conj(np.swapaxes(X, -1, -2))


def unitary_exp(X: Array) -> Array:
    """Exponential (..., N, N) of skew-Hermitian matrices; unitary to rounding."""
    angles, vectors = np.linalg.eigh(-1j * X)
    result = (vectors * np.exp(1j * angles)[..., None, :]) @ adjoint(vectors)
    return result if np.iscomplexobj(X) else np.asarray(result.real)


def unitary_log(U: Array, *, traceless: bool = False) -> tuple[Array, NDArray[np.bool_]]:
    """Shortest logarithms (..., N, N) of unitary matrices, and whether each is determined.

    The Cayley transform `(I - U) (I + U)^-1` of U is skew-Hermitian with the eigenvectors of U
    and eigenvalues `-i tan(angle / 2)`. Its eigenvectors are orthogonal even where eigenvalues
    coincide, and the angle is exact to rounding also where the tangent is large.

    Parameters
    ----------
    U : (..., N, N)
        Unitary matrices.
    traceless
        Look among the logarithms in su(N): where the principal angles add up to 2 pi k, the k
        largest are reduced by 2 pi.
    """
    identity = np.eye(U.shape[-1])
    # Where an eigenvalue is exactly -1 the shift keeps the system regular; such a logarithm is
    # reported as undetermined.
    total = U + (1.0 + 1e-15j) * identity
    cayley = np.linalg.solve(np.swapaxes(total, -1, -2), np.swapaxes(identity - U, -1, -2))
    hermitian = 1j * np.swapaxes(cayley, -1, -2)
    hermitian = 0.5 * (hermitian + adjoint(hermitian))
    tangents, vectors = np.linalg.eigh(hermitian)
    angles = 2.0 * np.arctan(tangents)
    determined = np.max(np.abs(cayley), axis=(-2, -1)) < _NEAR_HALF_TURN
    if traceless:
        angles, determined = _traceless(angles, determined)
    result = (vectors * (1j * angles)[..., None, :]) @ adjoint(vectors)
    return (result if np.iscomplexobj(U) else np.asarray(result.real)), determined


def _traceless(angles: Real, determined: NDArray[np.bool_]) -> tuple[Real, NDArray[np.bool_]]:
    """Angles (..., N), sorted upwards, changed by full turns so that they add up to 0.

    The least change in length turns the largest (or the least) of them; which ones is not
    determined where the next one is as large.
    """
    turns = np.rint(np.sum(angles, axis=-1) / (2.0 * np.pi)).astype(int)
    size = angles.shape[-1]
    rank = np.arange(size)
    up, down = np.maximum(-turns, 0)[..., None], size - np.maximum(turns, 0)[..., None]
    wall = np.full((*angles.shape[:-1], 1), 10.0)
    padded = np.concatenate([-wall, angles, wall], axis=-1)
    for edge in (up, down):
        gap = np.take_along_axis(padded, edge + 1, -1) - np.take_along_axis(padded, edge, -1)
        determined = determined & (gap[..., 0] > 1e-7)
    change = (rank < up).astype(float) - (rank >= down)
    return angles + 2.0 * np.pi * change, determined


def orthonormal_basis(matrices: Sequence[Array], scale: float) -> Array:
    """Orthonormal basis (n, N, N) of the span of matrices under `scale Re tr(X^* Y)`."""
    kept: list[Array] = []
    for matrix in matrices:
        X = np.asarray(matrix)
        for Y in kept:
            X = X - scale * np.real(np.vdot(Y, X)) * Y
        norm = np.sqrt(scale * np.real(np.vdot(X, X)))
        if norm > 1e-10:
            kept.append(X / norm)
    return np.stack(kept)


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

    def __init__(self, name: str, basis: Sequence[Array] | Array, scale: float) -> None:
        self.name = name
        self.scale = scale
        self.basis = orthonormal_basis(list(basis), scale)
        self.dimension = int(self.basis.shape[0])
        self.size = int(self.basis.shape[-1])

    def __repr__(self) -> str:
        return self.name

    @property
    def identity(self) -> Array:
        """The identity matrix (N, N) of the group."""
        return np.eye(self.size, dtype=self.basis.dtype)

    def algebra(self, v: Array) -> Array:
        """Matrix (..., N, N) in m of coordinates (..., n)."""
        return np.tensordot(np.asarray(v), self.basis, axes=1)

    def coordinates(self, X: Array) -> Real:
        """Coordinates (..., n) of the part in m of matrices (..., N, N)."""
        flat = np.conj(self.basis).reshape(self.dimension, -1)
        return self.scale * np.real(np.reshape(X, (*X.shape[:-2], -1)) @ flat.T)

    def inverse(self, g: Array) -> Array:
        """Inverse (..., N, N) of group elements."""
        return adjoint(g)

    def exp(self, v: Array) -> Array:
        """Group element (..., N, N) of coordinates (..., n): the geodesic with that rate."""
        return unitary_exp(self.algebra(v))

    def log(self, h: Array) -> Real:
        """Coordinates (..., n) of the shortest geodesic from the base point to that of h.

        Raises
        ------
        OutsideInjectivityRadiusError
            It is not determined.
        """
        v, determined = self.log_unchecked(h)
        if not np.all(determined):
            raise OutsideInjectivityRadiusError(
                self.name, "the element is on the cut locus of the identity"
            )
        return v

    def between(self, g: Array, h: Array) -> Real:
        """Coordinates (..., n) in the frame of g of the shortest geodesic from g to h.

        On the cut locus one of the shortest, to 1e-6.
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
    def curvature_term(self, v: Real, a: Real, j: Real) -> Real:
        """What the space adds to `v''' = sigma v' - F`, coordinates (..., n)."""

    @abstractmethod
    def in_frame(self, h: Array, w: Real) -> Real:
        """Coordinates (..., n) of a vector after a change of lift by h in K.

        A vector with coordinates w in the frame of `g h` has these in the frame of g.
        """
