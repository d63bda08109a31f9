# SPDX-License-Identifier: Apache-2.0
"""Basilisk's constrainedAttitudeManeuver: A* over a grid of attitudes, then a spline.

Method: R. Calaon, H. Schaub, Constrained Attitude Maneuvering via Modified-Rodrigues-Parameter-
Based Motion Planning Algorithms, Journal of Spacecraft and Rockets 59(4), 2022.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import constrainedAttitudeManeuver
from Basilisk.utilities import macros
from numpy.typing import NDArray

from benchmark.basilisk.plant import STEP, body_message, inertia_message
from benchmark.basilisk.reference import Reference, even_times, mrp_of_quaternion
from riem_planner import Problem

Array = NDArray[np.float64]

_MEAN_RATE = 0.04  # rad/s, as in the scenario
_INTERPOLATION = 0  # the spline goes through the grid's attitudes, as in the scenario
COSTS = {"effort": 1, "distance": 0}  # the scenario minimises effort


@dataclass(frozen=True, eq=False)
class Planned:
    """What the module planned.

    Parameters
    ----------
    reference
        As it writes it, a sample each step.
    duration
        [s]; the module decides on it.
    solve_time
        Of its `Reset` [s].
    """

    reference: Reference
    duration: float
    solve_time: float


def manoeuvre(problem: Problem, inertia: Array, refinement: int, cost: str, hold: float) -> Planned:
    """Plan a problem's slew with the module; its duration is not used.

    Parameters
    ----------
    problem
        With one keep-out and one group of keep-in zones of the same body, at rest at its ends.
    inertia : (3, 3)
        [kg m^2].
    refinement
        N, the grid's points along a half axis.
    cost
        Of `COSTS`: what A* minimises.
    hold
        How long the end is held [s].
    """
    start = messaging.SCStatesMsgPayload()
    start.sigma_BN = mrp_of_quaternion(problem.start.quaternion_xyzw).tolist()
    zones = problem.obstacles
    messages = {
        "scStateInMsg": messaging.SCStatesMsg().write(start),
        "vehicleConfigInMsg": inertia_message(inertia),
        "keepOutCelBodyInMsg": body_message(zones[0].direction),
        "keepInCelBodyInMsg": body_message(zones[0].direction),
    }
    module = constrainedAttitudeManeuver.ConstrainedAttitudeManeuver(refinement)
    module.sigma_BN_goal = mrp_of_quaternion(problem.goal.quaternion_xyzw).tolist()
    module.omega_BN_B_goal = [0.0, 0.0, 0.0]
    module.avgOmega = _MEAN_RATE
    module.BSplineType = _INTERPOLATION
    module.costFcnType = COSTS[cost]
    for zone in zones:
        keep_in = zone.kind == "keep_in"
        append = module.appendKeepInDirection if keep_in else module.appendKeepOutDirection
        append(zone.boresight.tolist(), zone.half_angle)
    for key, message in messages.items():
        getattr(module, key).subscribeTo(message)
    module.SelfInit()  # its C message has no memory before
    begun = time.perf_counter()
    module.Reset(0)
    solve_time = time.perf_counter() - begun
    duration = float(np.ravel(module.Output.T)[-1])
    return Planned(_sampled(module, duration + hold), duration, solve_time)


def _sampled(module: Any, duration: float) -> Reference:
    """What the module writes, every step."""
    times = even_times(duration, STEP)
    reader = messaging.AttRefMsgReader()
    reader.subscribeTo(module.attRefOutMsg)
    samples = np.empty((times.size, 3, 3))
    for k, t in enumerate(times):
        module.UpdateState(macros.sec2nano(t))
        payload = reader()
        samples[k] = payload.sigma_RN, payload.omega_RN_N, payload.domega_RN_N
    # The spline's parameters may be longer than 1: the other set is the same attitude.
    square = np.sum(samples[:, 0] ** 2, axis=1, keepdims=True)
    mrp = np.where(square > 1.0, -samples[:, 0] / np.maximum(square, 1.0), samples[:, 0])
    return Reference(times, mrp, samples[:, 1], samples[:, 2])
