# SPDX-License-Identifier: Apache-2.0
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

from riem_planner.trajectory import Trajectory, follow_turns

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
    return Trajectory(times, *follow_turns(np.array(start, dtype=float), *turns))


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
