# SPDX-License-Identifier: Apache-2.0
"""The simulations of the paper, as it computes them and as the corrected equations give them.

Paper: Bloch, Camarinha, Colombo, "Variational point-obstacle avoidance on Riemannian
manifolds". Section 7, item 5 of the mathematics says how its second example was reproduced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from riem_planner.extremals import extremal, snap
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.sphere import cross
from riem_planner.obstacles import Zone
from riem_planner.problem import S2, Problem, State
from riem_planner.solve import plan

Array = NDArray[np.float64]

EULER_STEP = 1e-3
"""Step of the paper's Euler method [s]."""

FREE_ANGLE = math.pi / 4
"""Angle about the boresight of the lift that the paper takes of an obstacle [rad]."""

PUBLISHED_DISTANCE = 2.54e-6
"""Least distance that the paper prints for its second example, tau = 1."""

BORESIGHT = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Example:
    """Initial data of a simulation on S^2, with the attitude I at time 0.

    Parameters
    ----------
    v, a, j : (3,)
        Rate and its first two derivatives at time 0.
    tension
        sigma [1/s^2].
    duration
        [s].
    obstacle_time
        t_q [s]: the obstacle is where the curve without it is at this time.
    """

    v: Array
    a: Array
    j: Array
    tension: float
    duration: float
    obstacle_time: float


GEODESIC = Example(
    v=np.array([0.0, 0.0, 1.0]),
    a=np.zeros(3),
    j=np.zeros(3),
    tension=0.0,
    duration=1.5,
    obstacle_time=1.0,
)
"""Figure 1: a great circle with the obstacle on it. The paper gives no data for it."""

CUBIC = Example(
    v=np.array([0.0, 4.0, -1.0]),
    a=np.array([0.0, -0.3, 0.5]),
    j=np.array([0.0, -1.0, 2.0]),
    tension=1.0,
    duration=0.6,
    obstacle_time=0.3,
)
"""Figures 2 and 3: the paper's initial data. It does not say where the obstacle is."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Sampled curve on S^2.

    Parameters
    ----------
    times : (n,)
        [s].
    points : (n, 3)
        Unit vectors x = R b.
    attitudes : (n, 3, 3)
        Rotation matrices.
    ends
        Time at which the curve could not be continued; infinite where it could.
    """

    times: Array
    points: Array
    attitudes: Array
    ends: float = math.inf

    def chord_distance(self, obstacle: Array) -> float:
        """Least chord `|x - q|` to a point (3,)."""
        return float(np.min(np.linalg.norm(self.points - obstacle, axis=1)))

    def distance(self, obstacle: Array) -> float:
        """Least angle [rad] to a point (3,)."""
        return float(np.min(sphere.angle(self.points, obstacle)))


def paper_literal(example: Example, strength: float, lift: Array | None = None) -> Curve:
    """The curve as the paper computes it: Euler's method on its printed equation.

    `v''' = (v' x v) x v + sigma v' + tau / (4 phi^3 sin phi) (R Q^T - Q R^T)^vee`, with R moved
    by the exponential map, no projection onto m, and one fixed lift Q of the obstacle.

    Parameters
    ----------
    example
        Initial data.
    strength
        tau.
    lift : (3, 3)
        Q; may be left out where the strength is 0.
    """
    h = EULER_STEP
    steps = round(example.duration / h)
    R, v, a, j = np.eye(3), example.v, example.a, example.j
    attitudes = [R]
    for _ in range(steps):
        snap = cross(cross(a, v), v) + example.tension * a
        if strength and lift is not None:
            difference = R @ lift.T
            relative = so3.vee(difference - difference.T)
            sine = 0.5 * math.sqrt(relative @ relative)
            phi = math.atan2(sine, 0.5 * (np.trace(difference) - 1.0))
            snap = snap + strength / (4.0 * phi**3 * math.sin(phi)) * relative
        R = R @ so3.exp(h * v)
        v, a, j = v + h * a, a + h * j, j + h * snap
        attitudes.append(R)
    R = np.stack(attitudes)
    times: Array = h * np.arange(steps + 1, dtype=float)
    return Curve(times, R @ BORESIGHT, R)


def paper_obstacle(example: Example, time: float | None = None) -> tuple[Array, Array]:
    """The paper's obstacle q (3,) at t_q on its curve without one, and its lift Q (3, 3)."""
    free = paper_literal(example, 0.0)
    t_q = example.obstacle_time if time is None else time
    R = free.attitudes[round(t_q / EULER_STEP)]
    return R @ BORESIGHT, R @ so3.exp([FREE_ANGLE, 0.0, 0.0])


def corrected(example: Example, strength: float, obstacle: Array | None = None) -> Curve:
    """The curve of the corrected equation, by DOP853 to 1e-11.

    F is half the gradient of `tau / d^2` with the distance d on S^2. The obstacle is on the
    curve's own path: the closer the curve comes, the harder it is thrown off, so it is followed
    only until its rate is ten times the initial one.
    """
    limit = 10.0 * float(np.linalg.norm(example.v))

    def field(_: float, y: Array) -> Array:
        q, v, a, j = y[:4], y[4:7], y[7:10], y[10:]
        force = np.zeros(3)
        if obstacle is not None:
            R = so3.quaternion_to_matrix(q / np.linalg.norm(q))
            direction = R.T @ obstacle
            gradient = cross(direction, BORESIGHT)
            sine = math.sqrt(gradient @ gradient)
            d = math.atan2(sine, direction @ BORESIGHT)
            force = -strength / d**3 * gradient / sine
        q_rate = 0.5 * np.append(q[3] * v + cross(q[:3], v), -(q[:3] @ v))
        return np.concatenate([q_rate, a, j, snap(S2, v, a, j, example.tension, force)])

    def too_fast(_: float, y: Array) -> float:
        return limit - float(np.linalg.norm(y[4:7]))

    too_fast.terminal = True  # type: ignore[attr-defined]
    start = np.concatenate([[0.0, 0.0, 0.0, 1.0], example.v, example.a, example.j])
    result = solve_ivp(
        field,
        (0.0, example.duration),
        start,
        method="DOP853",
        events=too_fast,
        dense_output=True,
        rtol=1e-11,
        atol=1e-11,
    )
    times = np.union1d(np.linspace(0.0, result.t[-1], 1501), result.t)
    q = result.sol(times)[:4].T
    R = so3.quaternion_to_matrix(q / np.linalg.norm(q, axis=1, keepdims=True))
    ends = float(result.t[-1]) if result.status == 1 else math.inf
    return Curve(times, R @ BORESIGHT, R, ends)


def boundary_value_problem(
    example: Example, strength: float | None = None, obstacle_time: float | None = None
) -> Problem:
    """The example with the end states of its curve without the obstacle, which is on that curve.

    Without a strength, the problem without the obstacle; without an obstacle time, the example's.
    """
    t_q = example.obstacle_time if obstacle_time is None else obstacle_time
    free = extremal(
        S2,
        State(np.eye(3), example.v),
        example.a,
        example.j,
        tension=example.tension,
        duration=example.duration,
    )
    R, v, _, _ = free.evaluate(np.array([t_q, example.duration]))
    obstacles = () if strength is None else (Zone(R[0, :, 0], 0.0, strength=strength, name="q"),)
    return Problem(
        start=State(np.eye(3), example.v),
        goal=State(R[1], v[1] * [0.0, 1.0, 1.0]),
        duration=example.duration,
        space=S2,
        tension=example.tension,
        obstacles=obstacles,
    )


def planned(problem: Problem, samples: int = 601) -> Curve:
    """The cheapest certified curve of a boundary-value problem, by `plan`."""
    trajectory = plan(problem)
    times = np.linspace(0.0, problem.duration, samples)
    R = trajectory.evaluate(times)[0]
    return Curve(times, R @ BORESIGHT, R)
