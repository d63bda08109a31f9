"""Coming to rest: a family of decelerations, and the gentlest one that may be flown.

The attitude is `R_0 exp(hat(xi(t)))` with, for `u = t / D` in [0, 1],

    xi'(t) = v (1 - 3 u^2 + 2 u^3) + a D u (1 - u)^2

so that body rate and acceleration begin at v and a, end at zero, and never jump. The peak of
the deceleration is about `1.5 |v| / D`, the turn on the way `D |v| / 2`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.geometry import so3
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]
Turns = tuple[Array, Array, Array]

SAMPLES = 25
SHORTEST = 0.2
"""Duration of a stop from next to nothing [s]."""
HARDER = 2.0
"""Ratio of the decelerations of one stop and the next."""
STOPS = 8
"""Decelerations that are tried."""


def trajectory_of_turns(start: ArrayLike, times: Array, turns: Turns) -> Trajectory:
    """Trajectory `R_0 exp(hat(xi))` of rotation vectors.

    Parameters
    ----------
    start : (4,)
        Unit quaternion of R_0, x, y, z, w.
    times : (n,)
        From 0 [s].
    turns : (n, 3) each
        xi [rad] and its first two time derivatives.
    """
    xi, xi_1, xi_2 = turns
    attitudes = so3.quaternion_multiply(np.asarray(start, dtype=float), so3.quaternion_exp(xi))
    rates = np.einsum("nij,nj->ni", so3.right_jacobian(xi), xi_1)
    accelerations = np.einsum("nij,nj->ni", so3.right_jacobian(xi), xi_2)
    accelerations = accelerations + _drift(xi, xi_1)
    return Trajectory(times, attitudes, rates, accelerations)


def _drift(xi: Array, xi_1: Array) -> Array:
    """Rate of change (n, 3) of the right Jacobian, times xi'; J is linear between two angles."""
    # d/dt of c(x) with c_1 = (1 - cos x)/x^2, c_2 = (x - sin x)/x^3, by their own derivatives
    # over x, from series that hold to 1e-15 below 0.5 rad and in closed form above.
    angle = np.linalg.norm(xi, axis=-1)[:, None]
    square = angle**2
    large = np.where(angle > 0.5, angle, 1.0)
    sine, cosine = np.sin(large), np.cos(large)
    first = np.where(angle > 0.5, (1 - cosine) / large**2, 0.5 * np.sinc(angle / 2 / np.pi) ** 2)
    series = 1 / 6 - square / 120 * (1 - square / 42 * (1 - square / 72 * (1 - square / 110)))
    second = np.where(angle > 0.5, (large - sine) / large**3, series)
    first_rate = np.where(
        angle > 0.5,
        (sine / large - 2 * first) / large**2,
        -1 / 12 + square / 180 - square**2 / 6720 + square**3 / 453600 - square**4 / 47900160,
    )
    second_rate = np.where(
        angle > 0.5,
        (first - 3 * second) / large**2,
        -1 / 60 + square / 1260 - square**2 / 60480 + square**3 / 4989600 - square**4 / 622702080,
    )
    inner = np.sum(xi * xi_1, axis=-1, keepdims=True)
    once = np.cross(xi, xi_1)
    return np.asarray(
        -first_rate * inner * once
        + second_rate * inner * np.cross(xi, once)
        + second * np.cross(xi_1, once)
    )


def deceleration(u: Array, duration: float, rate: Array, acceleration: Array) -> Turns:
    """Rotation vectors (n, 3) of a stop and their two time derivatives, at u = t / D (n,)."""
    u = u[:, None]
    v, a = rate * duration, acceleration * duration**2
    xi = v * (u - u**3 + 0.5 * u**4) + a * (u**2 / 2 - 2 * u**3 / 3 + u**4 / 4)
    xi_1 = (v * (1 - 3 * u**2 + 2 * u**3) + a * (u - 2 * u**2 + u**3)) / duration
    xi_2 = (v * (6 * u**2 - 6 * u) + a * (1 - 4 * u + 3 * u**2)) / duration**2
    return xi, xi_1, xi_2


def stop_trajectory(
    quaternion: ArrayLike, rate: ArrayLike, acceleration: ArrayLike, duration: float
) -> Trajectory:
    """The stop from a state that takes a given time.

    Parameters
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, body to reference frame.
    rate, acceleration : (3,)
        Body rate [rad/s] and body acceleration [rad/s^2] that it begins with.
    duration
        D [s].
    """
    u = np.linspace(0.0, 1.0, SAMPLES)
    v, a = np.asarray(rate, dtype=float), np.asarray(acceleration, dtype=float)
    return trajectory_of_turns(quaternion, duration * u, deceleration(u, duration, v, a))


def stops(
    quaternion: ArrayLike, rate: ArrayLike, acceleration: ArrayLike, gentlest: float
) -> Iterator[Trajectory]:
    """Stops from a state, from a gentle deceleration [rad/s^2] to 128 times that.

    Each turns by less than half of what the one before does.
    """
    speed = float(np.linalg.norm(np.asarray(rate, dtype=float)))
    for k in range(STOPS):
        duration = 1.5 * speed / (gentlest * HARDER**k)
        yield stop_trajectory(quaternion, rate, acceleration, max(duration, SHORTEST))
        if duration <= SHORTEST:
            return


def certified_stop(
    quaternion: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    gentlest: float,
    judge: Callable[[Trajectory], bool],
) -> Trajectory | None:
    """The gentlest stop that a judge accepts; None if it accepts none.

    Parameters
    ----------
    quaternion, rate, acceleration
        The state, as for `stop_trajectory`.
    gentlest
        The least peak of deceleration that is tried [rad/s^2].
    judge
        Whether a stop may be flown: a call of the certificate.
    """
    return next(
        (stop for stop in stops(quaternion, rate, acceleration, gentlest) if judge(stop)), None
    )
