"""The way out of a zone that has come over the spacecraft, or is about to.

Candidates are `R_0 exp(hat(xi(t)))`, the stop of `riem_planner.stop` plus a turn by an angle L
about a fixed body axis w with the minimum-jerk profile:

    xi(t) = xi_stop(t) + L w (10 u^3 - 15 u^4 + 6 u^5),   u = t / D.

Among many axes, angles and durations, the one whose least margin falls least before it is
positive is taken (from rest outside of all others: not at all), and of those the shortest way.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden
from riem_planner.stop import SHORTEST, deceleration, stop_trajectory, trajectory_of_turns
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

FINE = 1e-6
"""A fall of the margin that is rounding [rad]."""
_CHECKS = 49  # times at which a candidate's margins are looked at
_STEP = 1e-5  # of the finite differences of margins [rad]
_LONGER = (1.0, 1.15, 1.5, 2.0, 3.0, 5.0, 9.0)  # turns, relative to the margin that is missing
_FASTER = (1.0, 4.0, 16.0, 64.0)  # accelerations, relative to the gentle one


def uphill(forbidden: Forbidden, attitude: Array, time: float = 0.0) -> list[Array]:
    """Body axes (3,) about which a turn raises the margins: each violated set's, and their mean."""
    turns = so3.exp(_STEP * np.vstack([np.eye(3), -np.eye(3)]))
    around = forbidden.margins(attitude @ turns, time)
    here = forbidden.margins(attitude, time)
    gradients = []
    for name, margin in here.items():
        gradient = (around[name][:3] - around[name][3:]) / (2 * _STEP)
        norm = float(np.linalg.norm(gradient))
        if float(margin) <= 0.2 and norm > 1e-3:
            gradients.append((float(margin), gradient / norm))
    gradients.sort(key=lambda item: item[0])
    axes = [axis for _, axis in gradients]
    if len(axes) > 1:
        axes.append(np.sum(axes, axis=0))
        axes.append(axes[0] + axes[1])
    return axes


def _axes(forbidden: Forbidden, attitude: Array, moving: bool, rate: Array) -> Array:
    """Unit body axes (m, 3) that are tried."""
    grid = [np.array(corner, dtype=float) for corner in itertools.product((-1, 0, 1), repeat=3)]
    axes = uphill(forbidden, attitude) + [axis for axis in grid if np.any(axis)]
    if forbidden.pointing:
        # Without roll: about axes across the boresight, and while it moves, along its motion.
        axes = [rate, -rate] if moving else axes
        b = forbidden.boresight
        axes = [axis - (axis @ b) * b for axis in axes]
    kept = [axis / np.linalg.norm(axis) for axis in axes if np.linalg.norm(axis) > 1e-6]
    return np.array(kept).reshape(-1, 3)


def _profile(u: Array, duration: float) -> tuple[Array, Array, Array]:
    h = u**3 * (10 - 15 * u + 6 * u**2)
    h_1 = u**2 * (30 - 60 * u + 30 * u**2) / duration
    h_2 = u * (60 - 180 * u + 120 * u**2) / duration**2
    return h, h_1, h_2


def fall_before_exit(margins: Array) -> Array:
    """How far margins (..., n) fall below what they were, before they are positive for good.

    Outside from the start: how far inside it ever gets, plus a turn if it ends inside.
    """
    inside = margins <= 0.0
    last = np.where(
        inside.any(axis=-1),
        margins.shape[-1] - 1 - np.argmax(inside[..., ::-1], axis=-1),
        -1,
    )
    index = np.arange(margins.shape[-1])
    before = index <= last[..., None] + 1
    highest = np.maximum.accumulate(margins, axis=-1)
    fall = np.max(np.where(before, highest - margins, 0.0), axis=-1)
    return np.asarray(np.where(last == margins.shape[-1] - 1, fall + 2 * math.pi, fall))


def way_out(
    quaternion: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    forbidden: Forbidden,
    gentle: float,
    target: float,
) -> Trajectory:
    """The shortest way to where all margins are positive, falling as little as can be.

    Parameters
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, of the attitude it begins at.
    rate, acceleration : (3,)
        Body rate [rad/s] and acceleration [rad/s^2] that it begins with.
    forbidden
        What to come out of, at its places of time 0 and moving from there.
    gentle
        The acceleration to prefer [rad/s^2].
    target
        The margin to reach [rad], if it can be had.

    Returns
    -------
    Trajectory
        It is not certified: to be judged by `margin_report`, or by the certificate.
    """
    v, a = np.asarray(rate, dtype=float), np.asarray(acceleration, dtype=float)
    attitude = so3.quaternion_to_matrix(quaternion)
    speed = float(np.linalg.norm(v))
    axes = _axes(forbidden, attitude, speed > 1e-9, v)
    start = float(forbidden.least_margin(attitude))
    needed = max(target - start, 1e-3)
    lengths = np.unique(np.minimum(needed * np.array(_LONGER), math.pi))
    u = np.linspace(0.0, 1.0, _CHECKS)
    best: tuple[tuple[float, ...], Array, float] | None = None
    for faster in _FASTER:
        for length in lengths:
            duration = math.sqrt(6.0 * length / (gentle * faster))
            duration = max(duration, 1.5 * speed / (gentle * faster), SHORTEST)
            slowing = deceleration(u, duration, v, a)[0]
            turns = slowing[None] + length * axes[:, None, :] * _profile(u, duration)[0][:, None]
            margins = forbidden.least_margin(attitude @ so3.exp(turns), duration * u)
            falls = fall_before_exit(margins)
            short = np.maximum(0.0, target - margins[:, -1])
            for row in np.lexsort((short.round(3), falls.round(6)))[:1]:
                fall = max(0.0, float(falls[row]) - FINE)
                score = (round(fall, 4), round(float(short[row]), 3), faster, length)
                if best is None or score < best[0]:
                    best = (score, length * axes[row], duration)
        if best is not None and best[0][:2] == (0.0, 0.0):
            break  # harder is not better
    if best is None:
        return stop_trajectory(quaternion, v, a, max(1.5 * speed / gentle, SHORTEST))
    _, turn, duration = best
    h, h_1, h_2 = (step[:, None] for step in _profile(u, duration))
    xi, xi_1, xi_2 = deceleration(u, duration, v, a)
    combined = (xi + turn * h, xi_1 + turn * h_1, xi_2 + turn * h_2)
    return trajectory_of_turns(quaternion, duration * u, combined)
