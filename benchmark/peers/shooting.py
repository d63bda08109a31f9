# SPDX-License-Identifier: Apache-2.0
"""CasADi and IPOPT: direct multiple shooting of the cost, the usual way in optimal control.

N intervals of one Runge-Kutta step of order 4 each; the acceleration is linear between its
values at the nodes, which are the controls; state (quaternion, rate). Exact derivatives by
CasADi, IPOPT with MUMPS and its default tolerance; compiled programs with gcc -O1, since -O2
takes minutes to compile and is no faster. One program serves all problems of the same
space and kinds of obstacles: the numbers are parameters.

CasADi is a requirement of the benchmark only; `available()` says whether it is installed.
"""

from __future__ import annotations

import contextlib
import importlib.util
from functools import cache
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark.peers import PeerResult, hermite_guess, horizontal_basis
from riem_planner import Problem
from riem_planner.geometry import so3
from riem_planner.obstacles import OrientationObstacle

Array = NDArray[np.float64]

_TINY = 1e-20  # keeps the square root of a distance smooth at 0


def available() -> bool:
    """Whether CasADi is installed."""
    return importlib.util.find_spec("casadi") is not None


def _multiply(ca: Any, p: Any, q: Any) -> Any:
    vector = p[3] * q[:3] + q[3] * p[:3] + ca.cross(p[:3], q[:3])
    return ca.vertcat(vector, p[3] * q[3] - ca.dot(p[:3], q[:3]))


def _rotate(ca: Any, q: Any, x: Any) -> Any:
    """`R(q) x` for a unit quaternion."""
    turned = 2.0 * ca.cross(q[:3], x)
    return x + q[3] * turned + ca.cross(q[:3], turned)


def _conjugate(ca: Any, q: Any) -> Any:
    return ca.vertcat(-q[:3], q[3])


def _potential(ca: Any, kinds: str, q: Any, rows: Any) -> Any:
    """Sum of `tau / (d - r)^2`; a row of 9: place (4), boresight (3), radius, tau."""
    total = 0.0
    for i, kind in enumerate(kinds):
        place, boresight, radius, tau = rows[:4, i], rows[4:7, i], rows[7, i], rows[8, i]
        if kind == "o":
            p = _multiply(ca, _conjugate(ca, place), q)
            sine = ca.sqrt(ca.dot(p[:3], p[:3]) + _TINY)
            distance = 2.0 * ca.atan2(sine, ca.fabs(p[3]))
        else:
            x = _rotate(ca, q, boresight)
            square = ca.cross(x, place[:3])
            sine = ca.sqrt(ca.dot(square, square) + _TINY)
            distance = ca.atan2(sine, ca.dot(x, place[:3]))
        total += tau / (distance - radius) ** 2
    return total


def _step(ca: Any, kinds: str, k: int) -> Any:
    """One interval: state, controls at both ends and parameters to next state and cost."""
    state, a0, a1 = ca.SX.sym("x", 4 + k), ca.SX.sym("a0", k), ca.SX.sym("a1", k)
    basis, rows = ca.SX.sym("B", 3, k), ca.SX.sym("rows", 9, max(len(kinds), 1))
    sigma, h = ca.SX.sym("sigma"), ca.SX.sym("h")

    def rate(x: Any, a: Any) -> tuple[Any, Any]:
        v = basis @ x[4:]
        turn = 0.5 * _multiply(ca, x[:4], ca.vertcat(v, 0.0))
        running = ca.dot(a, a) + sigma * ca.dot(v, v) + _potential(ca, kinds, x[:4], rows)
        return ca.vertcat(turn, a), 0.5 * running

    middle = 0.5 * (a0 + a1)
    k1, c1 = rate(state, a0)
    k2, c2 = rate(state + 0.5 * h * k1, middle)
    k3, c3 = rate(state + 0.5 * h * k2, middle)
    k4, c4 = rate(state + h * k3, a1)
    following = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    cost = h / 6.0 * (c1 + 2.0 * c2 + 2.0 * c3 + c4)
    return ca.Function("step", [state, a0, a1, basis, rows, sigma, h], [following, cost])


@cache
def _program(kinds: str, k: int, intervals: int, compiled: bool) -> Any:
    """The IPOPT solver of all problems with k rates and these kinds of obstacles."""
    import casadi as ca

    n = 4 + k
    X, A = ca.MX.sym("X", n, intervals + 1), ca.MX.sym("A", k, intervals + 1)
    basis, rows = ca.MX.sym("B", 3, k), ca.MX.sym("rows", 9, max(len(kinds), 1))
    sigma, h = ca.MX.sym("sigma"), ca.MX.sym("h")
    start, goal, rate, tangents = (
        ca.MX.sym("start", n),
        ca.MX.sym("goal", 4),
        ca.MX.sym("rate", k),
        ca.MX.sym("tangents", 3, 3),
    )
    shoot = _step(ca, kinds, k).map(intervals)
    repeated = [ca.repmat(p, 1, intervals) for p in (basis, rows, sigma, h)]
    following, cost = shoot(X[:, :-1], A[:, :-1], A[:, 1:], *repeated)
    last = X[:, intervals]
    if k == 3:
        at_goal = [_multiply(ca, _conjugate(ca, goal), last[:4])[:3], last[4:] - rate]
    else:
        boresight = tangents[:, 2]
        velocity = _rotate(ca, last[:4], ca.cross(basis @ last[4:], boresight))
        across = tangents[:, :2].T
        at_goal = [across @ _rotate(ca, last[:4], boresight), across @ velocity - rate]
    constraints = ca.vertcat(X[:, 0] - start, ca.vec(X[:, 1:] - following), *at_goal)
    options: dict[str, Any] = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "ipopt.max_iter": 500,
    }
    if compiled:
        options |= {
            "jit": True,
            "compiler": "shell",
            "jit_cleanup": False,
            "jit_options": {"compiler": "gcc", "flags": ["-O1"], "verbose": False},
        }
    nlp = {
        "x": ca.vertcat(ca.vec(X), ca.vec(A)),
        "p": ca.veccat(basis, rows, sigma, h, start, goal, rate, tangents),
        "f": ca.sum2(cost),
        "g": constraints,
    }
    with contextlib.chdir(_build_folder().name):  # CasADi compiles in the working directory
        return ca.nlpsol("solver", "ipopt", nlp, options)


@cache
def _build_folder() -> TemporaryDirectory[str]:
    """Where compiled programs are built, removed when the process ends."""
    return TemporaryDirectory(prefix="riem_planner_benchmark_")


def structure(problem: Problem) -> str:
    """What problems of one program share: the space and the kinds of the obstacles in turn."""
    letters = ["o" if isinstance(o, OrientationObstacle) else "z" for o in problem.obstacles]
    return problem.space.name + ":" + "".join(letters)


class Shooting:
    """One problem for one of the programs; making it compiles the program if it is new."""

    def __init__(self, problem: Problem, intervals: int, compiled: bool = False) -> None:
        self.problem = problem
        self.intervals = intervals
        self.basis = horizontal_basis(problem)
        kinds = structure(problem).split(":")[1]
        self.program = _program(kinds, self.basis.shape[1], intervals, compiled)
        self.parameters = self._parameters()

    def _parameters(self) -> Array:
        problem, k = self.problem, self.basis.shape[1]
        rows = np.zeros((9, max(len(problem.obstacles), 1)))
        for i, o in enumerate(problem.obstacles):
            if isinstance(o, OrientationObstacle):
                rows[:4, i] = so3.matrix_to_quaternion(o.orientation)
            else:
                rows[:3, i], rows[4:7, i] = o.direction, o.boresight
            rows[7:, i] = o.radius, problem.strength_of(o)
        goal, start, b = problem.goal, problem.start, problem.boresight
        tangents = np.zeros((3, 3))
        rate = goal.angular_velocity
        if k == 2:
            tangents[:, :2] = np.linalg.svd((goal.orientation @ b)[None, :])[2][1:].T
            tangents[:, 2] = b
            rate = tangents[:, :2].T @ goal.orientation @ np.cross(goal.angular_velocity, b)
        parts = [
            self.basis,
            rows,
            problem.sigma,
            problem.duration / self.intervals,
            start.quaternion_xyzw,
            self.basis.T @ start.angular_velocity,
            goal.quaternion_xyzw,
            rate,
            tangents,
        ]
        return np.concatenate([np.ravel(np.asarray(p), order="F") for p in parts])

    def solve(self) -> PeerResult:
        """Solve from the Hermite guess."""
        times = np.linspace(0.0, self.problem.duration, self.intervals + 1)
        q, v, a, _ = hermite_guess(self.problem, times)
        guess = np.concatenate([np.hstack([q, v @ self.basis]).ravel(), (a @ self.basis).ravel()])
        bound = np.zeros(self.program.size1_out("g"))
        answer = self.program(x0=guess, p=self.parameters, lbg=bound, ubg=bound)
        values = np.asarray(answer["x"]).ravel()
        n, k = 4 + self.basis.shape[1], self.basis.shape[1]
        states = values[: n * len(times)].reshape(-1, n)
        controls = values[n * len(times) :].reshape(-1, k)
        success = bool(self.program.stats()["success"])
        return PeerResult(success, self._curve(times, states, controls), times)

    def _curve(self, times: Array, states: Array, controls: Array) -> Any:
        """The answer between its nodes: the integral of the linear acceleration."""
        h = times[1] - times[0]

        def curve(t: Array) -> tuple[Array, Array, Array]:
            i = np.clip(((t - times[0]) / h).astype(int), 0, self.intervals - 1)
            s = (t - times[i])[:, None]
            slope = (controls[i + 1] - controls[i]) / h
            v0, a0, B = states[i, 4:], controls[i], self.basis.T
            # Two Gauss points of the rate and their commutator: the Magnus step of order 4.
            offset = np.sqrt(3.0) / 6.0
            points = (0.5 - offset) * s, (0.5 + offset) * s
            w0, w1 = ((v0 + a0 * p + 0.5 * slope * p * p) @ B for p in points)
            turn = 0.5 * s * (w0 + w1) + 0.5 * offset * s * s * np.cross(w0, w1)
            q = so3.quaternion_multiply(states[i, :4], so3.quaternion_exp(turn))
            v = v0 + a0 * s + 0.5 * slope * s * s
            return q, v @ B, (a0 + slope * s) @ B

        return curve
