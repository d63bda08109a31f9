"""Boundary-value problems on a general space: descent from several curves, then shooting.

Plain NumPy and SciPy, without a demand on speed: it is the independent check of the compiled
solver, and the way to every space that one does not know.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from riem_planner.manifolds.descent import CoarseCost, descend
from riem_planner.manifolds.extremal import extremal_field
from riem_planner.manifolds.matrices import Real
from riem_planner.manifolds.problem import Array, GeneralProblem, Repulsion
from riem_planner.manifolds.shooting import Shooting, shoot
from riem_planner.manifolds.solution import GeneralSolution, GeneralTrajectory
from riem_planner.solution import Status

_COARSE_INTERVALS = 24
_SAMPLES = 16  # per interval, for clearance
_SAME = 1e-6  # relative difference of costs that means the same extremal


class _StopError(Exception):
    def __init__(self, status: Status) -> None:
        self.status = status


def solve_general(
    problem: GeneralProblem,
    *,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-11,
    detours: int = 4,
) -> GeneralSolution:
    """Solve a boundary-value problem on a compact group, a symmetric space or R^n.

    Parameters
    ----------
    problem
        The problem.
    deadline
        Time allowed [s]; by default none.
    should_stop
        Asked once an iteration; true ends the solve.
    tolerance
        Error allowed in the integration of an interval.
    detours
        Initial curves tried besides the geodesic: by way of points off it, some on the far
        side of the space. They are the same in every run.

    Returns
    -------
    GeneralSolution
        A value also where nothing was found.

    Raises
    ------
    OutsideInjectivityRadiusError
        The goal is on the cut locus of the start and there are no detours to take.
    """
    begin = time.monotonic()

    def check() -> None:
        if should_stop is not None and should_stop():
            raise _StopError(Status.CANCELLED)
        if deadline is not None and time.monotonic() - begin > deadline:
            raise _StopError(Status.OUT_OF_TIME)

    refused = _end_inside(problem)
    if refused is not None:
        return refused
    found: list[tuple[float, GeneralTrajectory, float]] = []
    iterations = 0
    stopped = None
    try:
        for curve in initial_curves(problem, detours):
            result = _refined(problem, curve, tolerance, check)
            if result is None:
                continue
            trajectory, error, used = result
            iterations += used
            cost = trajectory_cost(trajectory)
            if all(abs(cost - other) > _SAME * cost for other, _, _ in found):
                found.append((cost, trajectory, error))
    except _StopError as reason:
        stopped = reason.status
    elapsed = time.monotonic() - begin
    if stopped is not None:
        return GeneralSolution(
            stopped,
            f"stopped after {elapsed:.3g} s: {stopped.advice}",
            iterations=iterations,
            solve_time=elapsed,
        )
    return _best(problem, found, iterations, elapsed)


def _end_inside(problem: GeneralProblem) -> GeneralSolution | None:
    ends = {"start": Status.START_IN_ZONE, "goal": Status.GOAL_IN_ZONE}
    for key, status in ends.items():
        for name, margin in problem.margins(getattr(problem, key).element).items():
            if margin <= 0.0:
                message = f"the {key} is {-margin:.6g} inside of obstacle {name!r}"
                return GeneralSolution(status, message)
    return None


def _best(
    problem: GeneralProblem,
    found: list[tuple[float, GeneralTrajectory, float]],
    iterations: int,
    elapsed: float,
) -> GeneralSolution:
    for cost, trajectory, error in sorted(found, key=lambda entry: entry[0]):
        clearance = least_clearance(trajectory)
        if all(margin > 0.0 for margin in clearance.values()):
            others = sorted(((c, x) for c, x, _ in found if c > cost), key=lambda entry: entry[0])
            return GeneralSolution(
                Status.SOLVED,
                f"solved: cost {cost:.9g}",
                trajectory,
                cost,
                clearance,
                _boundary_error(trajectory),
                error,
                tuple(others),
                iterations,
                elapsed,
                (problem.space.remark,) if problem.space.remark else (),
            )
    message = "no initial curve led to an extremal that keeps off every obstacle"
    return GeneralSolution(
        Status.NO_CERTIFIED_TRAJECTORY, message, iterations=iterations, solve_time=elapsed
    )


def initial_curves(problem: GeneralProblem, detours: int) -> list[Array]:
    """Curves (N + 1, size, size): the geodesic, and some by way of a point off it."""
    space = problem.space
    start, goal = problem.start.element, problem.goal.element
    s = np.linspace(0.0, 1.0, _COARSE_INTERVALS + 1)
    if detours == 0:
        space.log(space.inverse(start) @ goal)  # raises where there is no one geodesic
    rng = np.random.default_rng(0)
    direct = space.between(start, goal)
    curves = []
    for k in range(detours + 1):
        # A little off, so that an obstacle on the geodesic is not met head-on; then far off.
        size = 1e-3 if k == 0 else (0.5, 1.5, 3.0)[k % 3]
        offset = rng.normal(size=space.dimension)
        middle = start @ space.exp(0.5 * direct) @ space.exp(size * offset / np.linalg.norm(offset))
        out, home = space.between(start, middle), space.between(middle, goal)
        first = start @ space.exp(2.0 * s[s < 0.5, None] * out)
        second = middle @ space.exp((2.0 * s[s >= 0.5, None] - 1.0) * home)
        curve = np.concatenate([first, second])
        curve[-1] = goal
        curves.append(curve)
    return curves


def _refined(
    problem: GeneralProblem, curve: Array, tolerance: float, check: Callable[[], None]
) -> tuple[GeneralTrajectory, float, int] | None:
    T, space = problem.duration, problem.space
    repulsion = Repulsion(space, problem.obstacles, T**4)
    cost = CoarseCost(problem, repulsion, _COARSE_INTERVALS)
    g, _ = descend(cost, curve, check)
    field = extremal_field(space, cost.sigma, repulsion)
    shooting = Shooting(space, field, problem.goal.element, cost.goal_rate)
    times = np.linspace(0.0, 1.0, _COARSE_INTERVALS + 1)
    result = shoot(shooting, times, *_nodes(cost, g), tolerance, check)
    if result is None:
        return None
    times, g, w, error, iterations = result
    return _along_one_lift(problem, shooting, times, g, w), error, iterations


def _nodes(cost: CoarseCost, g: Array) -> tuple[Array, Real]:
    """Shooting nodes (N, ...) with v, v', v'' by differences of a coarse curve (N + 1, ...)."""
    space, h = cost.space, 1.0 / cost.intervals
    # Lifts along the curve itself, so that differences of components are derivatives.
    lifts = [g[0]]
    for point in g[1:]:
        lifts.append(lifts[-1] @ space.exp(space.between(lifts[-1], point)))
    g = np.stack(lifts)
    onward, backward = space.between(g[:-1], g[1:]), space.between(g[1:], g[:-1])
    v = np.concatenate([cost.start_rate[None], (onward[1:] - backward[:-1]) / (2 * h)])
    a = np.empty((cost.intervals, space.dimension))
    a[1:] = (onward[1:] + backward[:-1]) / h**2
    a[0] = 2.0 * (onward[0] - h * cost.start_rate) / h**2
    j = np.gradient(a, h, axis=0)
    return g[:-1], np.stack([v, a, j], axis=1)


def _along_one_lift(
    problem: GeneralProblem, shooting: Shooting, times: Real, g: Array, w: Real
) -> GeneralTrajectory:
    """The trajectory with every node's lift turned into the one that the curve arrives with."""
    space = problem.space
    h = np.diff(times)
    elements, states = [g[0]], [w[0]]
    for k in range(len(h)):
        end_g, end_w = shooting.ends(elements[-1], states[-1], h[k])
        if k + 1 < len(h):
            turn = space.inverse(end_g) @ g[k + 1]
            # The point and the state are the node's own; only the lift is the one arrived with.
            end_w = space.in_frame(turn[None], w[k + 1])
            end_g = end_g @ space.exp(space.between(end_g, g[k + 1]))
        elements.append(end_g)
        states.append(end_w)
    return GeneralTrajectory(problem, times, np.stack(elements), np.stack(states))


def trajectory_cost(trajectory: GeneralTrajectory) -> float:
    """The cost, by Gauss's rule with eight points in each interval."""
    problem, T = trajectory.problem, trajectory.duration
    nodes, weights = np.polynomial.legendre.leggauss(8)
    h = np.diff(trajectory.times) * T
    t = trajectory.times[:-1, None] * T + 0.5 * h[:, None] * (nodes + 1.0)
    g, v, a = trajectory.evaluate(t)
    density = np.sum(a * a, axis=-1) + problem.tension * np.sum(v * v, axis=-1)
    density = density + Repulsion(problem.space, problem.obstacles).potential(g)
    return 0.25 * float(np.sum(h[:, None] * weights * density))


def least_clearance(trajectory: GeneralTrajectory) -> dict[str, float]:
    """Least distance to each obstacle's ball, by samples and what may happen between them.

    A distance changes at most as fast as the curve moves, so between samples a time h apart it
    is at least `(d_i + d_(i+1) - L h) / 2` with L the largest rate, here taken as the largest
    sampled one and what the sampled accelerations can add within h.
    """
    problem, T = trajectory.problem, trajectory.duration
    if not problem.obstacles:
        return {}
    fractions = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    s = (trajectory.times[:-1, None] + np.diff(trajectory.times)[:, None] * fractions).ravel()
    s = np.append(s, 1.0)
    g, v, a = trajectory.evaluate(s * T)
    h = np.diff(s) * T
    speed, bend = np.linalg.norm(v, axis=-1), np.linalg.norm(a, axis=-1)
    travelled = h * (np.maximum(speed[1:], speed[:-1]) + h * np.maximum(bend[1:], bend[:-1]))
    d, _ = Repulsion(problem.space, problem.obstacles).distances(g)
    bounds = np.min(0.5 * (d[1:] + d[:-1] - travelled[:, None]), axis=0)
    pairs = zip(problem.obstacles, bounds, strict=True)
    return {str(o.name): float(bound - o.radius) for o, bound in pairs}


def _boundary_error(trajectory: GeneralTrajectory) -> tuple[float, float]:
    problem = trajectory.problem
    space, goal = problem.space, problem.goal
    g, v, _ = trajectory.evaluate(trajectory.duration)
    turned = space.in_frame(space.inverse(goal.element) @ g, v)
    return (
        space.gap(g, goal.element),
        float(np.linalg.norm(turned - goal.rate)),
    )
