# SPDX-License-Identifier: Apache-2.0
"""The cost of a curve near a given one, computed on the sphere it lives on.

S^2 is the unit sphere of R^3; SO(3) is the unit sphere of R^4 (quaternions) with its lengths
doubled. Neither uses the equations of motion, so the first variation of this cost judges them.
"""

import numpy as np

from riem_planner.geometry import so3


def pointing_jet(R, v, a, b):
    """Direction x = R b with its first two derivatives, each (n, 3)."""
    rate, acceleration = np.cross(v, b), np.cross(a, b) + np.cross(v, np.cross(v, b))
    return tuple(
        np.einsum("nij,nj->ni", R, y) for y in (np.broadcast_to(b, v.shape), rate, acceleration)
    )


def quaternion_jet(R, v, a):
    """Quaternion, continuous in sign, with its first two derivatives, each (n, 4)."""
    q = so3.matrix_to_quaternion(R)
    for k in range(1, len(q)):
        q[k] *= 1.0 if q[k] @ q[k - 1] >= 0.0 else -1.0

    def pure(w):
        return np.concatenate([w, np.zeros((len(w), 1))], axis=1)

    rate = 0.5 * so3.quaternion_multiply(q, pure(v))
    acceleration = 0.5 * (
        so3.quaternion_multiply(rate, pure(v)) + so3.quaternion_multiply(q, pure(a))
    )
    return q, rate, acceleration


def cost(jet, weights, scale, sigma, potential):
    """1/2 int (|D^2 u|^2 + sigma |u'|^2 + V(u)) for the direction u of a jet (y, y', y'')."""
    y, y_1, y_2 = jet
    n = np.linalg.norm(y, axis=1, keepdims=True)
    u = y / n
    n_1 = np.sum(u * y_1, axis=1, keepdims=True)
    u_1 = (y_1 - n_1 * u) / n
    u_2 = (y_2 - np.sum(u * y_2, axis=1, keepdims=True) * u - 2.0 * n_1 * u_1) / n
    density = scale * np.sum(u_2**2 + sigma * u_1**2, axis=1) + potential(u)
    return 0.5 * float(weights @ density)


def first_variation(curve, duration, scale, sigma, potential, seed=0, epsilon=1e-4):
    """Largest derivative of the cost over some variations, relative to the variations' own size.

    Parameters
    ----------
    curve
        Function of times that returns a jet.
    potential
        Function of points (n, dimension) that returns values (n,).
    """
    nodes, weights = np.polynomial.legendre.leggauss(160)
    t = 0.5 * duration * (nodes + 1.0)
    weights = 0.5 * duration * weights
    jet = curve(t)
    rng = np.random.default_rng(seed)
    s = t / duration
    largest = 0.0
    for k in range(4):
        # s^2 (1 - s)^2 s^k and its derivatives: place and rate vanish at both ends.
        polynomial = np.poly1d([1.0, -2.0, 1.0, 0.0, 0.0]) * np.poly1d([1.0] + [0.0] * k)
        shape = [np.polyder(polynomial, m)(s) / duration**m for m in range(3)]
        direction = rng.normal(size=jet[0].shape[1])
        above, below = (
            cost(
                [
                    y + sign * epsilon * p[:, None] * direction
                    for y, p in zip(jet, shape, strict=True)
                ],
                weights,
                scale,
                sigma,
                potential,
            )
            for sign in (1.0, -1.0)
        )
        size = np.sqrt(np.sum(weights * shape[2] ** 2)) * np.linalg.norm(direction)
        largest = max(largest, abs(above - below) / (2.0 * epsilon * size))
    return largest
