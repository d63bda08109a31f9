# SPDX-License-Identifier: Apache-2.0
"""Newton's method on the discretised cost: always downhill, with the exact Hessian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from riem_planner.torque.cost import Motion, TorqueCost
from riem_planner.torque.splines import SplineMesh

Array = NDArray[np.float64]

_MOST_ITERATIONS = 100
_LONGEST_STEP = 0.5  # rad; the second variation says little further away
_ENOUGH = 1e-18  # of the cost, that a step still promises
_ROUNDING = 1e-13  # relative, of the cost
_SHIFTS = (0.0, *(10.0**k for k in range(-3, 7)))  # of the model, added to the Hessian


class Descent(NamedTuple):
    """Where the descent ended.

    Attributes
    ----------
    motion
        The curve at the mesh's points.
    iterations
        Newton steps.
    minimum
        Whether the Hessian is positive definite there.
    """

    motion: Motion
    iterations: int
    minimum: bool


def _factor(hessian: Array, model: Array) -> tuple[Array, bool]:
    """Cholesky factor of the Hessian, shifted by as much of the model as it needs."""
    for shift in _SHIFTS:
        try:
            return cholesky_banded(hessian + shift * model, lower=True), shift == 0.0
        except LinAlgError:
            continue
    return cholesky_banded(model, lower=True), False


def descend(cost: TorqueCost, mesh: SplineMesh, motion: Motion) -> Descent:
    """The nearest minimum of the cost downhill from a curve (at the mesh's points)."""
    value, minimum = cost.value(motion), False
    for iteration in range(_MOST_ITERATIONS):
        gradient, hessian, model = cost.variations(motion)
        slope = mesh.gradient(gradient)
        factor, minimum = _factor(mesh.hessian(hessian), mesh.hessian(model))
        step = -cho_solve_banded((factor, True), slope)
        promise = float(-slope @ step)
        if promise <= _ENOUGH * value:
            return Descent(motion, iteration, minimum)
        jets = mesh.jets(step)
        length = float(np.max(np.linalg.norm(jets[0], axis=1)))
        share = min(1.0, _LONGEST_STEP / length)
        while share > 1e-9:
            moved = motion.moved(*(share * jet for jet in jets))
            found = cost.value(moved)
            if found <= value - 0.1 * share * promise + _ROUNDING * value:
                break
            share *= 0.5
        else:
            return Descent(motion, iteration, minimum)
        settled = promise <= _ROUNDING * value and found >= value
        motion, value = moved, found
        if settled:
            return Descent(motion, iteration + 1, minimum)
    return Descent(motion, _MOST_ITERATIONS, minimum)
