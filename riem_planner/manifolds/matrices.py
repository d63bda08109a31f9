# SPDX-License-Identifier: Apache-2.0
"""Functions of unitary and skew-Hermitian matrices, batched.

What is not finite stays so in the result and never raises: a trial curve may leave every bound,
and is then refused by whoever tried it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Real = NDArray[np.float64]

_NEAR_HALF_TURN = 1e7  # tan(angle / 2) of an eigenvalue 2e-7 rad from -1
_BESIDE = 1e-4  # how far off a logarithm is looked for where eigenvalues coincide
_OFF = 1e-7  # part of a logarithm outside of an algebra that is taken for rounding
_MOST_BRANCHES = 20_000
_LATTICES: dict[int, NDArray[np.int64]] = {}


def bracket(X: Array, Y: Array) -> Array:
    """Commutator `X Y - Y X` (..., N, N)."""
    return np.asarray(X @ Y - Y @ X)


def adjoint(X: Array) -> Array:
    """Conjugate transpose (..., N, N), the inverse of a unitary matrix."""
    return np.conj(np.swapaxes(X, -1, -2))


def made_unitary(U: Array) -> Array:
    """The nearest unitary matrices (..., N, N), of matrices that are unitary to about 1e-8.

    Products in a chain, with the adjoint for the inverse, multiply what is off.
    """
    return np.asarray(1.5 * U - 0.5 * U @ adjoint(U) @ U)


def _finite(X: Array, instead: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The matrices (..., N, N), others in place of those that are not finite, and which are."""
    finite = np.asarray(np.isfinite(X).all(axis=(-2, -1)))
    return (X if finite.all() else np.where(finite[..., None, None], X, instead)), finite


def unitary_exp(X: Array) -> Array:
    """Exponential (..., N, N) of skew-Hermitian matrices; unitary to rounding."""
    X, finite = _finite(X, np.zeros(X.shape[-2:]))
    angles, vectors = np.linalg.eigh(-1j * X)
    result = (vectors * np.exp(1j * angles)[..., None, :]) @ adjoint(vectors)
    result = result if np.iscomplexobj(X) else np.asarray(result.real)
    return result if finite.all() else np.where(finite[..., None, None], result, np.nan)


def _eigen(U: Array) -> tuple[Real, Array, NDArray[np.bool_]]:
    """Angles in [-pi, pi] (..., N), eigenvectors, and whether none is half a turn.

    The Cayley transform `(I - U) (I + U)^-1` of U is skew-Hermitian with the eigenvectors of U
    and eigenvalues `-i tan(angle / 2)`. Its eigenvectors are orthogonal even where eigenvalues
    coincide, and the angle is exact to rounding also where the tangent is large.
    """
    identity = np.eye(U.shape[-1])
    # Where an eigenvalue is exactly -1 the shift keeps the system regular; such a logarithm is
    # reported as undetermined.
    total = U + (1.0 + 1e-15j) * identity
    cayley = np.linalg.solve(np.swapaxes(total, -1, -2), np.swapaxes(identity - U, -1, -2))
    hermitian = 1j * np.swapaxes(cayley, -1, -2)
    hermitian = 0.5 * (hermitian + adjoint(hermitian))
    tangents, vectors = np.linalg.eigh(hermitian)
    return 2.0 * np.arctan(tangents), vectors, np.abs(cayley).max((-2, -1)) < _NEAR_HALF_TURN


def unitary_log(U: Array, *, traceless: bool = False) -> tuple[Array, NDArray[np.bool_]]:
    """Shortest logarithms (..., N, N) of unitary matrices, and whether each is determined.

    Parameters
    ----------
    U : (..., N, N)
        Unitary matrices.
    traceless
        Look among the logarithms in su(N): where the principal angles add up to 2 pi k, the k
        largest are reduced by 2 pi.
    """
    U, finite = _finite(U, np.eye(U.shape[-1]))
    angles, vectors, determined = _eigen(U)
    if traceless:
        angles, determined = _traceless(angles, determined)
    result = (vectors * (1j * angles)[..., None, :]) @ adjoint(vectors)
    result = result if np.iscomplexobj(U) else np.asarray(result.real)
    if not finite.all():
        result = np.where(finite[..., None, None], result, np.nan)
    return result, determined


def _traceless(angles: Real, determined: NDArray[np.bool_]) -> tuple[Real, NDArray[np.bool_]]:
    """Angles (..., N), sorted upwards, changed by full turns so that they add up to 0.

    The least change in length turns the largest (or the least) of them; which ones is not
    determined where the next one is as large.
    """
    turns = np.rint(np.sum(angles, axis=-1) / (2.0 * np.pi)).astype(int)
    if not turns.any():
        return angles, determined
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


class Span:
    """A real space of matrices with an orthonormal basis.

    Parameters
    ----------
    matrices : (k, N, N)
        They span it; made orthonormal under `scale Re tr(X^* Y)`.
    scale
        Of that metric.
    """

    def __init__(self, matrices: Sequence[Array] | Array, scale: float) -> None:
        self.scale = scale
        self.basis = orthonormal_basis(list(matrices), scale)
        self.dimension, self.size = int(self.basis.shape[0]), int(self.basis.shape[-1])
        self._flat = np.ascontiguousarray(self.basis.reshape(self.dimension, -1))
        conjugate = scale * np.conj(self._flat).T
        self._real = np.ascontiguousarray(conjugate.real)
        self._imaginary = np.ascontiguousarray(-conjugate.imag)

    def matrices(self, v: Array) -> Array:
        """Matrices (..., N, N) of coordinates (..., n)."""
        v = np.asarray(v)
        return np.reshape(v @ self._flat, (*v.shape[:-1], self.size, self.size))

    def coordinates(self, X: Array) -> Real:
        """Coordinates (..., n) of the part of matrices (..., N, N) in the space."""
        flat = np.reshape(X, (*X.shape[:-2], -1))
        result = flat.real @ self._real
        if np.iscomplexobj(flat) and np.iscomplexobj(self.basis):
            result = result + flat.imag @ self._imaginary
        return np.asarray(result)

    def outside(self, X: Array) -> Real:
        """Largest element (...) of what matrices (..., N, N) have outside of the space."""
        return np.asarray(np.abs(X - self.matrices(self.coordinates(X))).max((-2, -1)))


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


def _lattice(size: int) -> NDArray[np.int64]:
    """Numbers of turns (k, N) that are tried for N eigenvalues."""
    if size not in _LATTICES:
        reach = max(int((_MOST_BRANCHES ** (1.0 / size) - 1.0) / 2.0), 1)
        if (2 * reach + 1) ** size > _MOST_BRANCHES:
            reach = 0
        turns = np.arange(-reach, reach + 1)
        grid = np.meshgrid(*[turns] * size, indexing="ij")
        _LATTICES[size] = np.stack([x.ravel() for x in grid], axis=-1)
    return _LATTICES[size]


def logarithms_in(span: Span, h: Array) -> list[tuple[Real, float]]:
    """Logarithms of one unitary matrix in an algebra, shortest first.

    All logarithms share the eigenvectors and differ by full turns of the angles: the turns that
    lead into the algebra are searched for. Where eigenvalues coincide their eigenvectors are
    arbitrary; there they are taken a little beside, and the logarithm is then corrected. One
    counts only if its exponential gives h back.

    Parameters
    ----------
    span
        The algebra.
    h : (N, N)
        The matrix.

    Returns
    -------
    list of (coordinates (n,), length)
        Empty where the group has no such element, or none was found.
    """
    n = span.dimension
    for beside in (0.0, _BESIDE):
        aside = unitary_exp(span.matrices(beside * np.cos(np.arange(1.0, n + 1.0))))
        angles, vectors, _ = _eigen(h @ aside)
        ranks_one = 1j * np.einsum("ai,bi->iab", vectors, np.conj(vectors))
        choices = angles + 2.0 * np.pi * _lattice(span.size)
        parts = span.coordinates(ranks_one) if np.iscomplexobj(span.basis) else None
        if parts is None:  # a real algebra: what is imaginary lies outside of it
            parts = span.coordinates(ranks_one.real)
        off = (ranks_one - span.matrices(parts)).reshape(span.size, -1)
        # Beside by 1e-4 the eigenvectors are known to about 1e-12 / 1e-4.
        inside = np.flatnonzero(np.abs(choices @ off).max(axis=1) < _OFF)
        lengths = np.sqrt(span.scale) * np.linalg.norm(choices[inside], axis=1)
        found = []
        for k in inside[np.argsort(lengths, kind="stable")][:8]:
            v = _corrected(span, h, choices[k] @ parts)
            if v is not None:
                found.append((v, float(np.linalg.norm(v))))
        if found:
            return sorted(found, key=lambda entry: entry[1])
    return []


def certain(found: list[tuple[Real, float]]) -> bool:
    """Whether there is a logarithm, and no other one as short."""
    return bool(found) and (len(found) == 1 or found[1][1] - found[0][1] > 1e-7)


def _corrected(span: Span, h: Array, v: Real) -> Real | None:
    """A logarithm near one, or None where there is none."""
    for _ in range(4):
        rest = adjoint(unitary_exp(span.matrices(v))) @ h
        if np.abs(rest - np.eye(span.size)).max() < 1e-13:
            break
        step = span.coordinates(unitary_log(rest)[0])
        # log(exp X exp Y) for a small Y: in the eigenvectors of X each element of Y is multiplied
        # by z / (1 - exp(-z)), with z the difference of two eigenvalues.
        angles, vectors = np.linalg.eigh(-1j * span.matrices(v))
        z = 1j * (angles[:, None] - angles)
        denominator = 1.0 - np.exp(-z)
        regular = np.abs(denominator) > 1e-6
        factor = np.where(regular, z / np.where(regular, denominator, 1.0), 1.0)
        Y = adjoint(vectors) @ span.matrices(step) @ vectors
        change = vectors @ (factor * Y) @ adjoint(vectors)
        v = v + span.coordinates(change if np.iscomplexobj(span.basis) else change.real)
    error = np.abs(unitary_exp(span.matrices(v)) - h).max()
    return v if error < 1e-10 else None
