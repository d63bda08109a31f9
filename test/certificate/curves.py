# SPDX-License-Identifier: Apache-2.0
"""Curves with known properties for the tests of the certificate."""

import numpy as np

from riem_planner import S2, SO3, Problem, State, Trajectory
from riem_planner.geometry import so3


def curve(start, coefficients, duration, samples, times=None):
    """Trajectory `start exp(sum_i coefficients[i] (t/T)^(i+1))` with its exact derivatives."""
    t = np.linspace(0.0, duration, samples) if times is None else times
    s = (t / duration)[:, None]
    c = np.asarray(coefficients, dtype=float)
    i = np.arange(1, len(c) + 1)
    xi = s**i @ c
    xi_1 = (i * s ** (i - 1)) @ c / duration
    xi_2 = (i * (i - 1) * s ** np.maximum(i - 2, 0)) @ c / duration**2
    J = so3.right_jacobian(xi)
    step = 1e-5 * duration
    J_1 = (so3.right_jacobian(xi + step * xi_1) - so3.right_jacobian(xi - step * xi_1)) / (2 * step)
    v = np.einsum("nij,nj->ni", J, xi_1)
    a = np.einsum("nij,nj->ni", J, xi_2) + np.einsum("nij,nj->ni", J_1, xi_1)
    q = so3.quaternion_multiply(start, so3.quaternion_exp(xi))
    return Trajectory(t, q, v, a)


def random_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_curve(rng, samples, duration=20.0):
    coefficients = rng.normal(size=(4, 3)) * np.array([[1.0], [0.5], [0.3], [0.2]])
    return curve(random_quaternion(rng), coefficients, duration, samples)


def problem_of(trajectory, obstacles=(), space=SO3, **options):
    """The problem whose end states are those of a trajectory."""
    q, v = trajectory.quaternions_xyzw, trajectory.angular_velocities
    ends = [State.from_quaternion_xyzw(q[i], v[i]) for i in (0, -1)]
    options = {"duration": trajectory.duration, "space": space, "obstacles": obstacles} | options
    return Problem(*ends, **options)


def slew(angle=2.0, duration=10.0, samples=21, axis=(0.0, 0.0, 1.0), rate=False):
    """About one axis from the identity: at a steady rate, or the cubic from rest to rest."""
    profile = [angle] if rate else [0.0, 3 * angle, -2 * angle]
    return curve([0.0, 0.0, 0.0, 1.0], np.outer(profile, axis), duration, samples)


def pointing_slew(samples=21):
    """Rest to rest on S^2 about z, the boresight x."""
    return slew(samples=samples), {"space": S2, "boresight": [1.0, 0.0, 0.0]}


def replaced(trajectory, **arrays):
    """The trajectory with some of its samples' arrays exchanged."""
    keys = ("times", "quaternions_xyzw", "angular_velocities", "angular_accelerations")
    return Trajectory(*(arrays.get(key, getattr(trajectory, key)) for key in keys))
