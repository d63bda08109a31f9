# SPDX-License-Identifier: Apache-2.0
"""From a discretised curve to the extremal near it, with an estimate of the error that is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from riem_planner.solver import shooting
from riem_planner.solver.curves import crosses_cut, mesh_and_states, shift_end
from riem_planner.solver.ends import hold_cost
from riem_planner.solver.setup import Setup
from riem_planner.solver.watch import Watch

Array = NDArray[np.float64]

_MOST_NEWTON_STEPS = 16
_VALLEY, _VALLEY_STEPS = 0.03, 6  # rad, along what is nearly a family of extremals
_MOST_MISSED = 1e-3  # of the goal's conditions, by one of a family
_DIVERGED = 2.5  # rad of one Newton step
_NEAR = 0.03  # rad; below it the defects are measured by half steps
_MOST_MESHES = 6
INTERVAL = 0.95  # of the mesh density's integral, on the first mesh
_LEAST_INTERVALS, _MOST_INTERVALS = 10, 160
_MOST_BISECTED = 600
# Halving a step divides the error of an 8th-order method by 256; half of that is claimed. Where a
# step may cross the edge of the rounded cut locus, which is only C^5, less is.
_HALVING, _HALVING_AT_CUT = 128.0, 8.0
# What an error of (attitude, v, a, j) makes of the attitude in unit time, roughly.
_EFFECT = np.repeat([1.0, 1.0, 1 / 2, 1 / 6], 3)
_SAFETY = 2.0  # of the error estimates, which are of first order
_ROUNDING = 1e-8  # defects that no longer halve below this are rounding, ...
_ORDINARY = 100.0  # ... of states as great as this
# Of an interval's cost; halving the step changes more only where the method's order does not show.
_ORDERLY = 1e-4


@dataclass(frozen=True)
class Extremal:
    """Solution of the first-order conditions in normalised time.

    Parameters
    ----------
    times : (n,)
    states : (n, 13)
        Quaternion, body rate and its two derivatives.
    cost
        Normalised.
    error, cost_error
        Estimates [rad], and relative. The error is infinite for one of a near family of extremals
        that was turned to meet the goal: which of them is the solution is not known.
    settled
        Whether it solves the first-order conditions; if not, it is a curve as good as was found.
    """

    times: Array
    states: Array
    cost: float
    error: float
    cost_error: float
    settled: bool = True


def extremal_near(
    setup: Setup, times: Array, q: Array, tolerance: float, watch: Watch, interval: float = INTERVAL
) -> Extremal | None:
    """Extremal near a discretised curve, or None where Newton's method finds none.

    The mesh is bisected where the estimate says so, until both error estimates are within the
    tolerance or the mesh is as fine as allowed; the estimates of the result say which.

    Parameters
    ----------
    times : (N + 1,)
    q : (N + 1, 4)
        Attitudes.
    tolerance
        [rad], and relative for the cost.
    interval
        Share of the mesh density's integral that an interval of the first mesh spans.
    """
    mesh, states = mesh_and_states(
        setup.pointing, setup.table, times, setup.lifted(q), setup.start, setup.goal,
        interval, _LEAST_INTERVALS, _MOST_INTERVALS,
    )  # fmt: skip
    result = None
    far = np.inf
    for _ in range(_MOST_MESHES):
        refined = _on_mesh(setup, mesh, states.copy(), far, tolerance, watch)
        if refined is None and result is None and not setup.pointing:
            refined = _on_mesh(setup, mesh, states, far, tolerance, watch, valley=_VALLEY)
        if refined is None:
            return result
        result, split = refined
        far = result.error
        if not split.any() or mesh.size + int(split.sum()) > _MOST_BISECTED:
            break
        mesh, states = _bisected(mesh, states, result, split)
    return result


def _on_mesh(
    setup: Setup,
    mesh: Array,
    states: Array,
    far: float,
    tolerance: float,
    watch: Watch,
    valley: float = np.inf,
) -> tuple[Extremal, NDArray[np.bool_]] | None:
    """Solve on a mesh; the extremal at nodes and half-way, and which intervals to bisect.

    `far` is how far [rad] the states are from it, roughly, and `valley` how long a step may be
    along what is nearly a family of extremals; after a few steps one of the family that
    nearly meets the goal has to do.
    """
    M = mesh.size - 1
    fixed = (setup.pointing, setup.table, setup.sigma, mesh, states)
    defects, whole = np.empty((M, 12)), np.empty((M, 13))
    step, left = np.empty((M + 1, 12)), np.empty((M + 1, 12))
    middles, costs, interpolation = np.empty((M, 13)), np.empty(M), np.empty(M)
    size, previous = far, np.inf
    residual, sensitivity = np.inf, 1.0
    gain, local, difference = np.zeros(M), np.zeros((M, 12)), np.zeros(M)
    polished, stalled, missed = False, False, 0.0
    limited, held = valley < np.inf, False
    for count in range(_MOST_NEWTON_STEPS):
        near = size < _NEAR
        if near:
            before = residual
            residual = shooting.measure(*fixed, defects, middles, costs, interpolation)
            if residual == np.inf:
                return None  # it runs through an obstacle
            rounded = _ROUNDING * max(1.0, float(np.abs(states[:, 4:]).max()) / _ORDINARY)
            stalled = residual > 0.5 * before and residual < rounded
            met = missed <= tolerance or held
            if polished and met and (sensitivity * residual <= 0.1 * tolerance or stalled):
                break
            if not polished:
                crossing = crosses_cut(setup.table, mesh, states).any(axis=0)
                gain = np.where(crossing, 1.0 / _HALVING_AT_CUT, 1.0 / _HALVING)
        watch.count()
        held = limited and count >= _VALLEY_STEPS
        most = 0.0 if held else valley
        missed = shooting.newton(*fixed, setup.goal, defects, near, gain, most, whole, step, left)
        if missed == np.inf:
            return None
        # The first step on half steps makes good for what whole ones did not see.
        previous = np.inf if near and not polished else size
        size = shooting.advance(states, step, 1.0)
        if not size < _DIVERGED or size > 4.0 * (max(previous, valley) if limited else previous):
            return None
        if near:
            # What halving the steps changes; it hardly depends on the states.
            local, difference = defects - whole[:, :12], np.abs(costs - whole[:, 12])
            polished = True
            # Least at 1: a lucky step must not make the estimate small.
            sensitivity = max(1.0, size / max(residual, 1e-300))
    else:
        return None
    if missed > (_MOST_MISSED if held else tolerance):
        return None
    cost = float(costs.sum()) + hold_cost(setup.table, setup.held, states[-1, :4])
    # What the half steps' own errors make of the solution, and the defects that are left.
    own = float(np.linalg.norm(left[:, :3], axis=1).max())
    # Where the defects are rounding, Newton's next step is no longer than the last one.
    rest = min(size, sensitivity * residual) if stalled else sensitivity * residual
    discretisation = _SAFETY * (own + rest)
    between = _SAFETY * interpolation
    error = discretisation + float(between.max())
    cost_gain = np.where(difference > _ORDERLY * np.abs(costs), 1.0, gain)
    cost_error = float(cost_gain @ difference) / max(cost, 1e-300)
    samples = np.empty((2 * M + 1, 13))
    samples[::2], samples[1::2] = states, middles
    times = np.empty(2 * M + 1)
    times[::2], times[1::2] = mesh, 0.5 * (mesh[1:] + mesh[:-1])
    if missed > tolerance:
        added = shift_end(setup.sigma, times, samples, setup.goal_at(samples[-1, :4]))
        cost_error += _SAFETY * abs(added) / cost
        return Extremal(times, samples, cost + added, np.inf, cost_error), np.zeros(M, dtype=bool)
    split = between > 0.5 * tolerance
    if discretisation > 0.5 * tolerance:
        share = gain * np.linalg.norm(local * _EFFECT, axis=1)
        split |= share > 0.1 * share.max()
    if cost_error > tolerance:
        split |= cost_gain * difference > 0.5 * tolerance * cost / M
    return Extremal(times, samples, cost, error, cost_error), split


def _bisected(
    mesh: Array, states: Array, result: Extremal, split: NDArray[np.bool_]
) -> tuple[Array, Array]:
    keep = np.ones(result.times.size, dtype=bool)
    keep[1::2] = split
    return result.times[keep].copy(), result.states[keep].copy()
