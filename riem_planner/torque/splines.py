# SPDX-License-Identifier: Apache-2.0
"""Rotation vectors as splines that vanish with their rates at both ends.

Quintic on every interval and twice continuously differentiable at the nodes, as trajectories are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import bsr_matrix, csr_matrix, kron, vstack

Array = NDArray[np.float64]

_DEGREE = 5
_BAND = 3 * (_DEGREE + 1)  # diagonals of a Hessian, the main one included
_GAUSS_POINTS = 6


class SplineMesh:
    """Nodes, quadrature points, and the splines' values there.

    Parameters
    ----------
    nodes : (n,)
        Increasing normalised times from 0 to 1.
    """

    def __init__(self, nodes: Array) -> None:
        self.nodes = nodes
        x, w = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
        h = np.diff(nodes)[:, None]
        # Every node, with weight 0, before the Gauss points of its interval.
        share = np.concatenate([[0.0], 0.5 * (x + 1.0)])
        self.points = np.append((nodes[:-1, None] + h * share).ravel(), 1.0)
        self.weights = np.append((h * np.concatenate([[0.0], 0.5 * w])).ravel(), 0.0)
        self.at_nodes = np.append(
            np.arange(nodes.size - 1) * (_GAUSS_POINTS + 1), self.points.size - 1
        )
        knots = np.concatenate([np.zeros(6), np.repeat(nodes[1:-1], 3), np.ones(6)])
        every = BSpline(knots, np.eye(knots.size - 6), _DEGREE)
        free = slice(2, -2)  # what is left out is not 0, or has a rate, at an end
        jets = [every.derivative(k) if k else every for k in range(3)]
        maps = [kron(csr_matrix(jet(self.points)[:, free]), np.eye(3)) for jet in jets]
        m = self.points.size
        order = np.arange(9 * m).reshape(3, m, 3).transpose(1, 0, 2).ravel()
        self._map = csr_matrix(vstack(maps).tocsr()[order])

    @property
    def unknowns(self) -> int:
        """Number of coefficients."""
        return int(self._map.shape[1])

    def jets(self, coefficients: Array) -> tuple[Array, Array, Array]:
        """Rotation vectors and two derivatives, each (m, 3), at the quadrature points."""
        rows = (self._map @ coefficients).reshape(-1, 3, 3)
        return rows[:, 0], rows[:, 1], rows[:, 2]

    def gradient(self, density: Array) -> Array:
        """Integral (unknowns,) of a density's derivatives (m, 9) by the jets."""
        return np.asarray(self._map.T @ (self.weights[:, None] * density).ravel())

    def hessian(self, density: Array) -> Array:
        """Lower diagonals (18, unknowns) of the integral of second derivatives (m, 9, 9)."""
        m = self.points.size
        blocks = bsr_matrix(
            (self.weights[:, None, None] * density, np.arange(m), np.arange(m + 1)),
            shape=(9 * m, 9 * m),
        )
        whole = (self._map.T @ (blocks @ self._map)).tocsr()
        band = np.zeros((_BAND, self.unknowns))
        for k in range(min(_BAND, self.unknowns)):
            band[k, : self.unknowns - k] = whole.diagonal(-k)
        return band
