# SPDX-License-Identifier: Apache-2.0
"""Effort, clearance and tracking error of a flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from riem_planner import Problem
from riem_planner.geometry import so3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """Integrals of a torque u over time: of `|u|` [N m s], of `|u|^2` [(N m)^2 s]."""

    norm: float
    square: float


def effort(torques: Array, step: float) -> Effort:
    """Effort of torques (n, 3) [N m], each held over a step [s] (the first, before 0, left out)."""
    norms = np.linalg.norm(torques[1:], axis=1)
    return Effort(float(np.sum(norms) * step), float(np.sum(norms**2) * step))


def rigid_torque(inertia: Array, rates: Array, accelerations: Array) -> Array:
    """`J a + v x J v` (n, 3) [N m] of rates and accelerations (n, 3) in the body's frame."""
    return np.asarray(accelerations @ inertia + np.cross(rates, rates @ inertia))


def margins(problem: Problem, quaternions: Array) -> dict[str, float]:
    """Least distance [rad] to each forbidden set over attitudes (n, 4); negative inside."""
    R = so3.quaternion_to_matrix(quaternions)
    along = problem.forbidden.margins(R)
    return {name: float(np.min(values)) for name, values in along.items()}


def between_samples(rates: Array, step: float) -> float:
    """What a distance [rad] can fall below its least sample, at body rates (n, 3) [rad/s].

    Between two samples no attitude is farther from the nearer one than half a step's turn; the
    rate within a step exceeds that at its ends by no more than it changes in one.
    """
    change = np.max(np.linalg.norm(np.diff(rates, axis=0), axis=1))
    return float(0.5 * step * (np.max(np.linalg.norm(rates, axis=1)) + change))


def disagreement(problem: Problem, quaternions: Array, angles: dict[str, Array]) -> float:
    """Largest difference [rad] of zone angles (n,), measured by another, from our own."""
    R = so3.quaternion_to_matrix(quaternions)
    return max(
        float(np.max(np.abs(angles[str(zone.name)] - zone.distance(R, 0.0))))
        for zone in problem.obstacles
    )
