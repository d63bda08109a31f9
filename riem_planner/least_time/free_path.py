# SPDX-License-Identifier: Apache-2.0
"""Level (b): the free path, from starts of several classes, coarse and then on the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from riem_planner.least_time.interior_point import Outcome, interior_point
from riem_planner.least_time.model import Iterate, Model
from riem_planner.least_time.paths import integrated, motion
from riem_planner.least_time.transcription import Frame, used_constraints
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

COARSE = 40
"""Intervals on which the starts are followed."""

TIGHTENING = 5e-4
"""Part by which limits are taken smaller, so that they hold between the nodes too."""

_ROOM = 0.7  # part of the limits that a start uses
_SLACK, _WARM_SLACK = 1e-2, 1e-3
_BARRIERS, _WARM_BARRIERS = (1e-2, 1e-6), (1e-5, 3e-8)
_MOST, _MOST_WARM = 45, 60  # iterations
_WARM_STRETCH = 1.02
_NEAR = 1e-3  # of constraints, steps and ends
_LEAST_SIZE = 1e-9  # rad


@dataclass(frozen=True, eq=False)
class Optimum:
    """A local optimum of the transcription.

    Parameters
    ----------
    duration
        T [s].
    iterate
        Attitudes, rates and accelerations at the nodes.
    converged
        Whether it is one, to tolerance.
    near
        Whether constraints and dynamics hold nearly, so that it is worth to go on from.
    iterations
        How many it took.
    """

    duration: float
    iterate: Iterate
    converged: bool
    near: bool
    iterations: int


def _solved(
    model: Model, motion: tuple[Array, Array, Array], stretch: float, duration: float, warm: bool
) -> Optimum:
    used = used_constraints(model)
    n, c = used.shape[0] - 1, used.shape[1]
    slack = _WARM_SLACK if warm else _SLACK
    q, V, A = (np.ascontiguousarray(each) for each in motion)
    iterate = Iterate(
        q, V, A, np.array([stretch**model.power]), np.full((n + 1, c), slack),
        np.zeros((n + 1, c)), np.zeros((n + 1, 3)),
    )  # fmt: skip
    barriers, most = (_WARM_BARRIERS, _MOST_WARM) if warm else (_BARRIERS, _MOST)
    outcome, iterations, missed = interior_point(iterate, model, used, barriers, most)
    T = duration * float(iterate.p[0]) ** (1.0 / model.power)
    return Optimum(T, iterate, outcome is Outcome.CONVERGED, missed < _NEAR, iterations)


def followed(frame: Frame, path: Array) -> Optimum:
    """The optimum near a path (n + 1, 4), on its own nodes."""
    V, A = motion(path)
    if not frame.rolling:
        V[:, 0] = A[:, 0] = 0.0
    duration = frame.slower(V, A, _ROOM)
    size = max(float(np.max(np.abs(V))), _LEAST_SIZE)
    model = frame.model(len(path) - 1, duration, size, TIGHTENING)
    return _solved(model, (path.copy(), V, A), 1.0, duration, False)


def refined(frame: Frame, coarse: Optimum, intervals: int, tightening: float) -> Optimum:
    """A coarse optimum on another number of nodes."""
    old = coarse.iterate
    s = np.linspace(0.0, 1.0, len(old.V))
    times = np.linspace(0.0, 1.0, intervals + 1)
    A = np.stack([np.interp(times, s, column) for column in old.A.T], axis=1)
    V = integrated(old.V[0], A)
    flips = np.cumprod(np.where(np.sum(old.q[1:] * old.q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q = np.concatenate([old.q[:1], old.q[1:] * flips[:, None]])
    path = Trajectory(s, q, old.V, old.A).evaluate_quaternion(times)[0]
    path[[0, -1]] = q[[0, -1]]
    size = max(float(np.max(np.abs(V))), _LEAST_SIZE)
    model = frame.model(intervals, coarse.duration, size, tightening)
    return _solved(model, (path, V, A), _WARM_STRETCH, coarse.duration, True)
