"""PROVISIONAL (straight slew only); the real solver replaces it, same signatures."""
import time

import numpy as np

from riem_planner.certificate import certify
from riem_planner.errors import PlanningError
from riem_planner.geometry import so3
from riem_planner.solution import Solution, Status
from riem_planner.trajectory import Trajectory


def solve(problem, *, deadline=None, should_stop=None, tolerance=1e-8, warm_start=None, search="global"):
    begin = time.monotonic()
    if should_stop is not None and should_stop():
        return Solution(Status.CANCELLED, "cancelled")
    for status, state, t in ((Status.START_IN_ZONE, problem.start, 0.0), (Status.GOAL_IN_ZONE, problem.goal, problem.duration)):
        for name, margin in problem.margins(state.orientation, t).items():
            if margin <= 0:
                return Solution(status, f"{status.name}: inside zone {name}")
    T = problem.duration
    q0, q1 = problem.start.quaternion_xyzw, problem.goal.quaternion_xyzw
    xi = so3.quaternion_log(so3.quaternion_multiply(so3.quaternion_conjugate(q0), q1))
    v0, v1 = problem.start.angular_velocity, so3.right_jacobian_inverse(xi) @ problem.goal.angular_velocity
    c = np.zeros((4, 3))
    c[1] = v0
    c[2] = (3 * xi / T - 2 * v0 - v1) / T
    c[3] = (v0 + v1 - 2 * xi / T) / T**2
    s = np.linspace(0, T, 101)[:, None]
    x, x1, x2 = c[1] * s + c[2] * s**2 + c[3] * s**3, c[1] + 2 * c[2] * s + 3 * c[3] * s**2, 2 * c[2] + 6 * c[3] * s
    q = so3.quaternion_multiply(q0, so3.quaternion_exp(x))
    v = np.einsum("nij,nj->ni", so3.right_jacobian(x), x1)
    trajectory = Trajectory(s[:, 0], q, v, np.gradient(v, s[:, 0], axis=0))
    certificate = certify(trajectory, problem)
    status = Status.SOLVED if certificate.certified else Status.NO_CERTIFIED_TRAJECTORY
    return Solution(status, "; ".join(certificate.reasons) or "solved", trajectory if certificate.certified else None, certificate, 1.0, 0.0, 0.0, True, True, (), 1, time.monotonic() - begin)


def plan(problem, **options):
    solution = solve(problem, **options)
    if solution.trajectory is None:
        raise PlanningError(solution)
    return solution.trajectory


def solve_many(problems, *, jobs=None, **options):
    return [solve(p, **options) for p in problems]


def warm_up(notify=None):
    return None
