# SPDX-License-Identifier: Apache-2.0
"""References as Basilisk states them: modified Rodrigues parameters, rates in the inertial frame.

With R the attitude (body to reference frame, as everywhere in this project) and [BN] Basilisk's
direction cosine matrix (reference frame N to body B), `[BN] = R^T`. The parameters of both
are `sigma = q_vec / (1 + q_w)` of R's quaternion: Basilisk's matrix of sigma is
`I + (8 S^2 - 4 (1 - sigma^2) S) / (1 + sigma^2)^2` with `S = hat(sigma)`, the transpose of
the rotation by q (Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner import Trajectory
from riem_planner.geometry import so3
from riem_planner.simulation.dynamics import Target

Array = NDArray[np.float64]


def mrp_of_quaternion(quaternion: ArrayLike) -> Array:
    """Modified Rodrigues parameters (..., 3), of length at most 1, of quaternions (..., 4)."""
    q = np.asarray(quaternion, dtype=float)
    q = np.where(q[..., 3:] < 0.0, -q, q)
    return np.asarray(q[..., :3] / (1.0 + q[..., 3:]))


def quaternion_of_mrp(mrp: ArrayLike) -> Array:
    """Unit quaternions (..., 4), x, y, z, w, of modified Rodrigues parameters (..., 3)."""
    sigma = np.asarray(mrp, dtype=float)
    square = np.sum(sigma**2, axis=-1, keepdims=True)
    return np.concatenate([2.0 * sigma, 1.0 - square], axis=-1) / (1.0 + square)


@dataclass(frozen=True, eq=False)
class Reference:
    """What the attitude-tracking modules are fed at each step.

    Parameters
    ----------
    times : (n,)
        Evenly spaced from 0 [s].
    mrp : (n, 3)
        sigma_RN, of length at most 1.
    rates, accelerations : (n, 3)
        omega_RN and its derivative, components in the inertial frame [rad/s], [rad/s^2].
    """

    times: Array
    mrp: Array
    rates: Array
    accelerations: Array

    @classmethod
    def of_body(
        cls, times: Array, quaternions: Array, rates: Array, accelerations: Array
    ) -> Reference:
        """From quaternions (n, 4) and rates and accelerations (n, 3) in the body's frame.

        `(R v)' = R a`: the derivative in the inertial frame is that in the body's.
        """
        R = so3.quaternion_to_matrix(quaternions)
        turned = (np.einsum("nij,nj->ni", R, vectors) for vectors in (rates, accelerations))
        return cls(times, mrp_of_quaternion(quaternions), *turned)

    @property
    def quaternions(self) -> Array:
        """Attitudes (n, 4), x, y, z, w."""
        return quaternion_of_mrp(self.mrp)

    def body(self) -> tuple[Array, Array]:
        """Rates [rad/s] and accelerations [rad/s^2], (n, 3) each, in the body's frame."""
        R = so3.quaternion_to_matrix(self.quaternions)
        rates, accelerations = (
            np.einsum("nji,nj->ni", R, vectors) for vectors in (self.rates, self.accelerations)
        )
        return rates, accelerations


def even_times(duration: float, step: float) -> Array:
    """Times (n,) [s], a step apart, from 0 to the first that is not before the duration."""
    return step * np.arange(int(np.ceil(duration / step - 1e-9)) + 1)


def streamed(
    trajectory: Trajectory, step: float, setpoint_rate: float = 10.0, hold: float = 0.0
) -> Reference:
    """A trajectory as a controller knows it that hears of it at a setpoint rate.

    Between setpoints the last one is extrapolated with its rate and acceleration. After its end
    the last attitude is held at rest.

    Parameters
    ----------
    step
        Between the samples of the reference [s].
    setpoint_rate
        [Hz]; a setpoint spans a whole number of steps.
    hold
        How long the end is held [s].
    """
    times = even_times(trajectory.duration + hold, step)
    per = round(1.0 / (setpoint_rate * step))
    heard = (np.arange(times.size) // per) * per
    targets = [_target(trajectory, t) for t in times[::per]]
    known = [targets[k // per].after(float(times[i] - times[k])) for i, k in enumerate(heard)]
    return Reference.of_body(
        times,
        np.array([target.quaternion for target in known]),
        np.array([target.rate for target in known]),
        np.array([target.acceleration for target in known]),
    )


def _target(trajectory: Trajectory, time: float) -> Target:
    """The setpoint of a time [s]; past the end it is at rest."""
    target = Target(*trajectory.evaluate_quaternion(min(time, trajectory.duration)))
    return target if time < trajectory.duration else target.at_rest()
