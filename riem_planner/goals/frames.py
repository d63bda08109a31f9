# SPDX-License-Identifier: Apache-2.0
"""Frames that moving directions carry along.

The frame of two directions d, d_2 is `[e_1, e_2, e_3]` with `e_1 = d`, e_2 the unit part of d_2
orthogonal to it, `e_3 = e_1 x e_2`. With its angular velocity w, `e_i' = w x e_i`, so

    w  = e_1 x e_1' + (e_3 . e_2') e_1
    w' = e_1 x (e_1'' - w x (w x e_1)) + (e_3 . (e_2'' - w x (w x e_2))) e_1.

One direction carries a frame without turning it about itself: `L' = hat(d x d') L`, integrated
by the Magnus expansion to fourth order (Iserles et al., Acta Numerica 2000, section 5.3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path, Turning

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array]
"""Unit vectors (..., 3) with their first and second time derivatives."""

_STEP = 0.01  # rad that a direction moves in a step of the transport: its error is of fifth order
_LOOKS = 201  # at how far it moves
_GAUSS = 0.5 / np.sqrt(3.0)  # of a step, either side of its middle


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(np.sum(x * y, axis=-1, keepdims=True))


def _unit_motion(p: Array, p_1: Array, p_2: Array) -> Motion:
    """Motion of `p / |p|`."""
    n = np.linalg.norm(p, axis=-1, keepdims=True)
    s = p / n
    n_1 = _dot(s, p_1)
    s_1 = (p_1 - n_1 * s) / n
    n_2 = _dot(s, p_2) + n * _dot(s_1, s_1)
    return s, s_1, (p_2 - n_2 * s - 2.0 * n_1 * s_1) / n


def frame_of_two(first: Motion, second: Motion) -> Motion:
    """Frames (..., 3, 3) of two directions, with angular velocities and accelerations (..., 3).

    The columns of a frame are e_1, e_2, e_3; its rates are in the frame that the directions are
    given in.
    """
    e_1, e_1_1, e_1_2 = first
    d, d_1, d_2 = second
    along = _dot(d, e_1)
    along_1 = _dot(d_1, e_1) + _dot(d, e_1_1)
    along_2 = _dot(d_2, e_1) + 2.0 * _dot(d_1, e_1_1) + _dot(d, e_1_2)
    e_2, e_2_1, e_2_2 = _unit_motion(
        d - along * e_1,
        d_1 - along_1 * e_1 - along * e_1_1,
        d_2 - along_2 * e_1 - 2.0 * along_1 * e_1_1 - along * e_1_2,
    )
    e_3 = np.cross(e_1, e_2)
    w = np.cross(e_1, e_1_1) + _dot(e_3, e_2_1) * e_1
    bend_1, bend_2 = (x - np.cross(w, np.cross(w, e)) for x, e in ((e_1_2, e_1), (e_2_2, e_2)))
    return np.stack([e_1, e_2, e_3], axis=-1), w, np.cross(e_1, bend_1) + _dot(e_3, bend_2) * e_1


def transported(direction: Turning | Path, begin: float, times: Array) -> Array:
    """Rotations (..., 3, 3) that take a direction along from `begin`, without turning about it.

    Parameters
    ----------
    begin
        Time at which they are the identity [s].
    times : (...)
        From `begin` on [s].
    """
    marks, place = np.unique(times, return_inverse=True)
    marks = np.insert(marks, 0, begin)
    edges = _edges(direction, marks)
    # Turns of all steps at once; what is left to do one by one is their product.
    h = np.diff(edges)[:, None]
    middles = 0.5 * (edges[1:] + edges[:-1])
    early, late = (
        _carrying_rate(direction, middles + side * _GAUSS * h[:, 0]) for side in (-1.0, 1.0)
    )
    turns = so3.exp(0.5 * h * (early + late) + np.sqrt(3.0) / 12.0 * h * h * np.cross(late, early))
    products = np.empty((edges.size, 3, 3))
    products[0] = np.eye(3)
    for k, turn in enumerate(turns):
        products[k + 1] = turn @ products[k]
    L = products[np.searchsorted(edges, marks[1:])]
    # What the expansion leaves of the direction itself is taken away.
    d = direction.direction_at(marks)
    left = so3.quaternion_to_matrix(so3.minimal_rotation(L @ d[0], d[1:]))
    return np.asarray((left @ L)[place.ravel()].reshape(*times.shape, 3, 3))


def _edges(direction: Turning | Path, marks: Array) -> Array:
    """Times of steps, the marks (n,) among them, between which the direction moves little."""
    looks = np.linspace(marks[0], marks[-1], _LOOKS)
    moved = np.linalg.norm(np.diff(direction.direction_at(looks), axis=0), axis=1)
    between = np.searchsorted(looks, marks)
    angle = np.concatenate([[0.0], np.cumsum(moved)])[between]
    counts = 1 + (np.diff(angle) / _STEP).astype(int)
    parts = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(marks[:-1], marks[1:], counts, strict=True)
    ]
    return np.concatenate([*parts, marks[-1:]])


def _carrying_rate(direction: Turning | Path, times: Array) -> Array:
    d, d_1, _ = direction.motion_at(times)
    return np.cross(d, d_1)
