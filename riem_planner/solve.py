# SPDX-License-Identifier: Apache-2.0
"""The two public steps: state a `Problem`, solve it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from riem_planner import kernel_cache
from riem_planner.certificate import Certificate, certify
from riem_planner.certificate.walls import find_wall
from riem_planner.cost import trajectory_cost
from riem_planner.duration import Solve, advised, solve_auto
from riem_planner.geometry import so3, sphere
from riem_planner.goals import PointingGoal
from riem_planner.hold import contact, hold_trajectory
from riem_planner.kernels import announced, place
from riem_planner.limits import Limits
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.obstacles.potential import margins_along, rounding, row_margins
from riem_planner.problem import LEAST_TIME, S2, SO3, Problem, State
from riem_planner.solution import Alternative, PlanningError, Solution, Status
from riem_planner.solver import shooting
from riem_planner.solver.curves import crosses_cut, shift_end
from riem_planner.solver.descent import positive_definite
from riem_planner.solver.ends import hold_cost, settled
from riem_planner.solver.extremal import Extremal, extremal_near
from riem_planner.solver.rescue import remedies
from riem_planner.solver.search import (
    WORTHLESS,
    Curve,
    Search,
    global_search,
    local_search,
    roadmap_search,
)
from riem_planner.solver.setup import Setup, set_up
from riem_planner.solver.watch import InterruptedSolveError, Watch
from riem_planner.trajectory import Trajectory, follow_turns

if TYPE_CHECKING:
    from riem_planner.manifolds import GeneralProblem, GeneralSolution, GeneralTrajectory

Array = NDArray[np.float64]

_MOST_RESULTS = 3  # extremals that are computed for one problem
# Of the mesh density's integral between nodes, where shooting failed; each mesh fits better.
_FINER = (0.3, 0.12, 0.12, 0.12)
_ROADMAP_TIME = 0.5  # s that the last resort may take
_INERTIA_NODES = 100  # about as many as decide whether an extremal is a minimum
# On S^2: rate about the boresight between samples [rad/s], where in an interval a quintic's is
# greatest, and how often samples are doubled for it.
_MOST_ROLL, _ROLLS_AT, _MOST_DOUBLINGS = 6e-10, 0.5 + np.array([-0.5, 0.5]) / np.sqrt(5.0), 3
_SMALL_MOVE, _FAR_OUT = np.radians(3.0), 2.0  # a move, and of it how far from its start is far
_TOLD_ANGLE = np.radians(1e-3)  # of a second axis, below which its direction counts as met
_CUT_SAMPLES = 100  # an interval, for the part of the cost that rounding the cut locus hides
_NOTE_FAMILY = (
    "one of many ways of nearly equal cost round an obstacle; which of them is cheapest was not"
    " determined, so that no error is stated; the certificate holds all the same"
)
_NOTE_UNSETTLED = (
    "certified, but no extremal: shooting on the first-order conditions failed, and the path comes"
    " from {}; its cost is its own, and a cheaper path may be near"
)
_NOTE_CUT = (
    "the trajectory passes the cut locus of an obstacle (distance pi), where the plain potential"
    " has a kink: it is an extremal of the potential rounded within 0.1 rad of it; give the"
    " obstacle a range to taper the potential instead"
)


@overload
def solve(
    problem: Problem,
    *,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-8,
    warm_start: Trajectory | None = None,
    search: Literal["global", "local"] = "global",
    samples: int | None = None,
) -> Solution: ...


@overload
def solve(
    problem: GeneralProblem,
    *,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-8,
    warm_start: GeneralTrajectory | None = None,
    search: Literal["global", "local"] = "global",
    samples: None = None,
) -> GeneralSolution: ...


def solve(
    problem: Problem | GeneralProblem,
    *,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-8,
    warm_start: Any = None,
    search: Literal["global", "local"] = "global",
    samples: int | None = None,
) -> Solution | GeneralSolution:
    """Cheapest certified trajectory of a problem.

    Parameters
    ----------
    problem
        What to solve; on a space given by its matrices a `GeneralProblem`, which is solved in
        plain NumPy and SciPy.
    deadline
        Time limit for everything [s], by a steady clock; but for the first solve of a process,
        which loads the compiled code before (0.6 s), or compiles it where it never ran.
    should_stop
        Called between iterations; true withdraws the request. A `StopFlag` of
        `riem_planner.solver.watch` does not keep other threads waiting.
    tolerance
        Requested error of the trajectory [rad], and relative error of the cost.
    warm_start
        A trajectory near the one looked for, such as the one that flies; its whole length is
        taken to fit the problem's.
    search
        `global` tries every class of paths worth it; `local` only the straightest, or that of
        the warm start. Of a problem of least time `local` is the quickest motion along that path.
    samples
        Of the trajectory of a problem of least time, whose accelerations change from one to the
        next; by default 201.

    Returns
    -------
    Solution
        A value whatever happens: `status` says how it went and what to do about it. Of a
        `GeneralProblem` a `GeneralSolution`.
    """
    if not isinstance(problem, Problem):
        from riem_planner.manifolds import solve_general  # slow to load, and seldom needed

        return solve_general(
            problem, deadline=deadline, should_stop=should_stop, tolerance=1e-3 * tolerance,
            warm_start=warm_start, detours=0 if search == "local" else 4,
            both_sides=search != "local",
        )  # fmt: skip
    if problem.objective != LEAST_TIME:  # which needs them for some problems only
        _load_kernels()
    watch = Watch(deadline, should_stop)

    def fixed(problem: Problem, near: Trajectory | None, *, local: bool = False) -> Solution:
        _load_kernels()
        return _solve(problem, watch, tolerance, near or warm_start, local or search == "local")

    def single(problem: Problem) -> Solution:
        if problem.objective == LEAST_TIME:
            return _least_time(problem, watch, fixed, samples, warm_start, search == "local")
        if problem.has_auto_duration:
            return _walled_off(problem) or solve_auto(problem, fixed)
        solution = fixed(problem, None)
        if solution.status is Status.LIMITS_EXCEEDED:
            solution = advised(problem, solution, fixed)
        return solution

    try:
        if isinstance(problem.goal, tuple):
            solution = _of_several(problem, single)
        else:
            solution = single(problem)
    except InterruptedSolveError as interruption:
        status = interruption.status
        what = "the deadline passed" if status is Status.OUT_OF_TIME else "cancelled"
        solution = Solution(
            status,
            f"{what} after {watch.elapsed:.3g} s and {watch.iterations} iterations;"
            f" {status.advice}",
        )
    # Of the whole request, however many solves it took and however it ended.
    return replace(solution, iterations=watch.iterations, solve_time=watch.elapsed)


def _of_several(problem: Problem, single: Callable[[Problem], Solution]) -> Solution:
    """The cheapest of the solutions for each goal; where the duration is automatic, the shortest.

    Goals in a zone drop out with a note.
    """
    found = [single(problem.with_goal(i)) for i in range(len(problem.goals))]
    notes = [
        f"goal.any_of[{i}] drops out: {solution.message}"
        for i, solution in enumerate(found)
        if solution.status is Status.GOAL_IN_ZONE
    ]
    solved = [i for i, solution in enumerate(found) if solution.trajectory is not None]
    if not solved:
        # What stands against a goal that is no mistake says more than that others are in a zone.
        refused = [s for s in found if s.status is not Status.GOAL_IN_ZONE] or found
        told = "; ".join(f"goal.any_of[{i}]: {s.message}" for i, s in enumerate(found))
        return replace(refused[0], message=told)

    def expense(i: int) -> float:
        trajectory = found[i].trajectory
        assert trajectory is not None  # it is one of the solved
        return trajectory.duration if problem.has_auto_duration else found[i].cost

    best = min(solved, key=expense)
    chosen = found[best]
    return replace(
        chosen,
        message="; ".join([chosen.message, *notes]),
        notes=(*chosen.notes, *notes),
        goal_index=best,
    )


def _least_time(
    problem: Problem,
    watch: Watch,
    fixed: Solve,
    samples: int | None,
    path: Trajectory | None,
    local: bool,
) -> Solution:
    from riem_planner.least_time import SAMPLES, LeastTime  # slow to load, and not always needed

    if not problem.goals[0].moves:
        refusal = _end_in_zone(problem.timed(1.0), set_up(problem.timed(1.0)))
        # Where zones move the goal may be clear by the time of arrival.
        clears = problem.forbidden.moving and refusal and refusal.status is Status.GOAL_IN_ZONE
        if refusal is not None and not clears:
            return refusal
    request = LeastTime(problem, watch, fixed, SAMPLES if samples is None else samples)
    return request.along(path) if local else request.solve()


def plan(problem: Problem, **options: Any) -> Trajectory:
    """Cheapest certified trajectory of a problem, with the options of `solve`.

    Raises
    ------
    PlanningError
        There is none; the error carries the solution.
    """
    solution = solve(problem, **options)
    if solution.trajectory is None:
        raise PlanningError(solution)
    return solution.trajectory


def solve_many(
    problems: Iterable[Problem], *, jobs: int | None = None, **options: Any
) -> list[Solution]:
    """Solve many problems, in order, on `jobs` threads (by default one a core).

    The compiled solver runs outside the interpreter lock, so threads share the work without
    copies; each result equals that of `solve`, bit for bit.
    """
    with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
        return list(pool.map(lambda problem: solve(problem, **options), problems))


def warm_up(notify: Callable[[str], None] | None = None) -> None:
    """Load the compiled solver, compiling it first where it never ran.

    Parameters
    ----------
    notify
        Receives a message if compilation takes a while, and what is wrong with the folders in
        which compiled code is kept.
    """
    import riem_planner.solver.roadmap  # noqa: F401  what else loads when it is first needed

    tell_whom = notify or (lambda _: None)
    with announced(tell_whom):
        _load_kernels()
    kernel_cache.tell(tell_whom)


@cache
def _load_kernels() -> None:
    """Solve a small problem of each space, so that all compiled code is in memory."""
    zone = Zone(np.array([0.0, 1.0, 0.3]), 0.1, normalized_strength=0.01)
    start, goal = (State.from_direction(x) for x in ([1.0, 0.0, 0.0], [-0.6, 0.8, 0.0]))
    limits = Limits(rate=1e3, torque=1e3, inertia=np.eye(3))
    # The attitude opposite to the way's middle: its cut locus is crossed.
    away = OrientationObstacle(so3.exp([0.0, 0.0, -2.0]), normalized_strength=0.01)
    for space, obstacles in ((SO3, (zone, away)), (S2, (zone,))):
        problem = Problem(start, goal, 1.0, space, obstacles=obstacles, limits=limits)
        solution = _solve(problem, Watch(None, None), 1e-8, None, False)
        _solve(problem, Watch(None, None), 1e-8, solution.trajectory, True)
    # What only few problems need.
    setup = set_up(problem)
    shift_end(1.0, np.array([0.0, 1.0]), np.ones((2, 13)), setup.goal[:7])
    margins_along(setup.table, 0.0, np.ones((1, 4)))
    follow_turns(np.ones(4), *np.zeros((3, 1, 3)))
    settled(setup.goal, np.ones(4))
    place().complete()


def _solve(
    problem: Problem, watch: Watch, tolerance: float, warm_start: Trajectory | None, local: bool
) -> Solution:
    setup = set_up(problem)
    refusal = _end_in_zone(problem, setup)
    if refusal is None and not local:
        refusal = _walled_off(problem)
    if refusal is not None:
        return refusal
    found = (local_search if local else global_search)(setup, watch, warm_start)
    solution = _best(problem, setup, found, tolerance, watch, 1 if local else _MOST_RESULTS)
    # Where only limits are broken there are paths enough, and the answer is a longer duration.
    if not solution.solved and solution.status is not Status.LIMITS_EXCEEDED:
        wider = not local and watch.has_time_for(_ROADMAP_TIME)
        # Of doors that open and close the search sees little: what it found is of little use.
        if not problem.forbidden.moving or not wider:
            solution = _rescued(problem, setup, found, tolerance, watch, warm_start) or solution
        if not solution.solved and wider:
            solution = _by_roadmap(problem, setup, found, tolerance, watch)
        if not solution.solved and wider and problem.forbidden.moving:
            solution = _rescued(problem, setup, found, tolerance, watch, warm_start) or solution
    least = found.least_cost / problem.duration**3
    return replace(solution, classes_tried=found.tried, least_cost=least)


def _by_roadmap(
    problem: Problem, setup: Setup, found: Search, tolerance: float, watch: Watch
) -> Solution:
    """The best answer near shortest paths over a grid; how far was looked, if there is none."""
    by_roadmap = roadmap_search(setup, watch)
    solution = _best(problem, setup, by_roadmap, tolerance, watch, _MOST_RESULTS)
    if not solution.solved:
        solution = _rescued(problem, setup, by_roadmap, tolerance, watch, None) or solution
    if solution.solved:
        return solution
    looked = f"{found.tried} curves and shortest paths over a grid were tried"
    message = solution.message.replace(
        solution.status.advice, f"{looked}; {solution.status.advice}"
    )
    return replace(solution, message=message)


def _rescued(
    problem: Problem,
    setup: Setup,
    found: Search,
    tolerance: float,
    watch: Watch,
    warm_start: Trajectory | None,
) -> Solution | None:
    """The cheapest certified path of the first remedy that has one; None if none has."""
    for remedy in remedies(setup, found, tolerance, watch, warm_start):
        answers: list[Certified] = []
        try:
            for chain in remedy.chains:
                certified = (_certified(problem, setup, path) for path in chain)
                answers.extend(islice((answer for answer in certified if answer), 1))
        except InterruptedSolveError:
            if not answers:
                raise
        if answers:
            return _solution(problem, setup, answers, tolerance, watch, remedy.name)
    return None


def _certified(problem: Problem, setup: Setup, path: Extremal) -> Certified | None:
    """A path with its trajectory and own cost, if that is certified."""
    trajectory = published(problem, setup, path)
    certificate = certify(trajectory, problem)
    if not certificate.certified:
        return None
    if not path.settled:
        path = replace(path, cost=_cost_of(problem, setup, trajectory))
    return Certified(path, trajectory, certificate)


def _cost_of(problem: Problem, setup: Setup, trajectory: Trajectory) -> float:
    """Normalised cost of a trajectory by quadrature, with that of a hold."""
    end = so3.quaternion_multiply(trajectory.quaternions_xyzw[-1], setup.body)
    held: float = hold_cost(setup.table, setup.held, end)
    return trajectory_cost(trajectory, problem) * problem.duration**3 + held


def _walled_off(problem: Problem) -> Solution | None:
    """The refusal of a problem whose start and goal are parted by a wall of zones."""
    wall = find_wall(problem)
    if not wall:
        return None
    status = Status.NO_CERTIFIED_TRAJECTORY
    return Solution(
        status,
        f"no certified trajectory: the goal is sealed off by the wall of {', '.join(wall)}, so that"
        f" no path leads to it, whatever its timing; {status.advice}",
        wall=wall,
    )


def _end_in_zone(problem: Problem, setup: Setup) -> Solution | None:
    if not np.all(row_margins(setup.table, 0.0, setup.start) > 0.0):
        status = Status.START_IN_ZONE
        for name, margin in problem.margins(problem.start.orientation).items():
            if margin <= 0.0:
                return Solution(
                    status,
                    f"the start is {np.degrees(-margin):.4g} degrees inside the forbidden set of"
                    f" {name!r}; {status.advice}",
                )
    if problem.hold == 0.0 and np.all(row_margins(setup.table, 1.0, setup.goal) > 0.0):
        return None
    found = contact(problem)
    if found is None:
        return None
    status = Status.GOAL_IN_ZONE
    return Solution(status, f"{found.sentence(problem.duration)}; {status.advice}")


def _best(
    problem: Problem, setup: Setup, found: Search, tolerance: float, watch: Watch, enough: int
) -> Solution:
    """The cheapest of `enough` certified extremals near the curves, the others as alternatives."""
    extremals: list[Extremal] = []
    certified: list[Certified] = []
    refused: Certificate | None = None
    for curve in found.minima:
        worthless = bool(extremals) and curve.cost > WORTHLESS * extremals[0].cost
        if len(extremals) == _MOST_RESULTS or len(certified) == enough or worthless:
            break
        # What only is an alternative is worth less effort.
        finer = _FINER[:2] if extremals else _FINER
        extremal = _extremal(setup, found, curve, finer, tolerance, watch)
        if extremal is None or any(_same(extremal, other) for other in extremals):
            continue
        extremals.append(extremal)
        trajectory = published(problem, setup, extremal)
        certificate = certify(trajectory, problem)
        if certificate.certified:
            certified.append(Certified(extremal, trajectory, certificate))
        elif refused is None or certificate.breaks_only_limits > refused.breaks_only_limits:
            refused = certificate
    if not certified:
        only_limits = refused is not None and refused.breaks_only_limits
        status = Status.LIMITS_EXCEEDED if only_limits else Status.NO_CERTIFIED_TRAJECTORY
        why = "; ".join(refused.reasons) if refused else "no path was found through the zones"
        return Solution(
            status,
            f"no certified trajectory: {why}; {status.advice}",
            certificate=refused,
        )
    return _solution(problem, setup, certified, tolerance, watch)


class Certified(NamedTuple):
    """A path, the trajectory that it is published as, and the verdict on that."""

    path: Extremal
    trajectory: Trajectory
    certificate: Certificate


def _solution(
    problem: Problem,
    setup: Setup,
    certified: list[Certified],
    tolerance: float,
    watch: Watch,
    remedy: str = "",
) -> Solution:
    """The cheapest of certified paths as the answer, the others as its alternatives."""
    certified = sorted(certified, key=lambda item: item.path.cost)
    scale = problem.duration**-3
    best, trajectory, certificate = certified[0]
    if setup.pointing and best.settled:
        trajectory = _without_roll(problem, setup, best, trajectory)
        certificate = certify(trajectory, problem)
    alternatives = tuple(
        Alternative(scale * _stated_cost(problem, setup, e, t), c.clearance, t)
        for e, t, c in certified[1:]
    )
    notes = []
    if crosses_cut(setup.table, best.times, best.states).any():
        notes.append(_NOTE_CUT)
    notes += _goal_notes(problem)
    notes += _excursion_notes(problem, trajectory)
    converged = best.settled and best.error <= tolerance and best.cost_error <= tolerance
    if not best.settled:
        notes.append(_NOTE_UNSETTLED.format(remedy))
    elif not np.isfinite(best.error):
        notes.append(_NOTE_FAMILY)
    elif not converged:
        notes.append(
            f"the tolerance {tolerance:.1e} was not reached: error {best.error:.1e} rad, relative"
            f" cost error {best.cost_error:.1e}; the certificate holds all the same"
        )
    return Solution(
        status=Status.SOLVED,
        message="; ".join([f"solved and certified in {1e3 * watch.elapsed:.2f} ms", *notes]),
        trajectory=trajectory,
        certificate=certificate,
        cost=scale * _stated_cost(problem, setup, best, trajectory),
        trajectory_error=best.error,
        cost_error=best.cost_error,
        local_minimum=_is_minimum(setup, best) if best.settled else None,
        converged=converged,
        alternatives=alternatives,
        hold=hold_trajectory(problem, trajectory),
        notes=tuple(notes),
    )


def _excursion_notes(problem: Problem, trajectory: Trajectory) -> list[str]:
    """Whether obstacles push a small move from rest to rest far out and back."""
    ends = (problem.start.angular_velocity, problem.arrival.angular_velocity)
    if not problem.obstacles or np.any(ends):
        return []
    q = trajectory.quaternions_xyzw
    if problem.space == S2:
        x = so3.quaternion_to_matrix(q) @ problem.boresight
        away = sphere.angle(x[0], x)
    else:
        away = so3.quaternion_distance(q[0], q)
    slew, furthest = float(away[-1]), float(away.max())
    if slew > _SMALL_MOVE or furthest < _FAR_OUT * slew + _SMALL_MOVE:
        return []
    return [
        f"obstacles push this move of {np.degrees(slew):.3g} degrees up to"
        f" {np.degrees(furthest):.3g} degrees away and back; a lower normalized_strength keeps it"
        " closer"
    ]


def _goal_notes(problem: Problem) -> list[str]:
    """What a user should know of the problem's statement, and of a goal that can't be met."""
    goal = problem.goals[0]
    left = goal.remaining_angle(problem.duration) if isinstance(goal, PointingGoal) else 0.0
    notes = [*problem.notes]
    if left > _TOLD_ANGLE:
        notes.append(f"goal.second: {np.degrees(left):.4g} degrees are left to its direction")
    return notes


def _extremal(
    setup: Setup,
    found: Search,
    curve: Curve,
    finer: tuple[float, ...],
    tolerance: float,
    watch: Watch,
) -> Extremal | None:
    """The extremal near a curve; where Newton's method fails, near the curve on finer nodes."""
    extremal = extremal_near(setup, curve.times, curve.q, tolerance, watch)
    for interval in finer:
        if extremal is not None:
            break
        curve, _ = found.finer(curve, interval)
        if curve.cost < np.inf:
            extremal = extremal_near(setup, curve.times, curve.q, tolerance, watch, 2.0 * interval)
    return extremal


def _same(first: Extremal, second: Extremal) -> bool:
    return abs(first.cost - second.cost) <= 1e-7 * abs(first.cost)


def _is_minimum(setup: Setup, extremal: Extremal) -> bool:
    # Not all samples of a very fine mesh, where rounding decides, not the problem; but fewer may
    # be too few where much happens at once.
    n = extremal.times.size
    for stride in sorted({1 + n // _INERTIA_NODES, 1}, reverse=True):
        keep = np.arange(0, n, stride)
        keep[-1] = n - 1
        times, q = extremal.times[keep], np.ascontiguousarray(extremal.states[keep, :4])
        if positive_definite(
            setup.pointing, setup.table, setup.sigma, times, setup.with_goal(q),
            setup.start[4:], setup.goal,
        ):  # fmt: skip
            return True
    return False


def _stated_cost(
    problem: Problem, setup: Setup, extremal: Extremal, trajectory: Trajectory
) -> float:
    """Normalised cost with the potentials as stated, kinks at the cut locus included."""
    if not extremal.settled:
        return extremal.cost
    crossing = crosses_cut(setup.table, extremal.times, extremal.states)
    near = np.flatnonzero(crossing.any(axis=0))
    if near.size == 0:
        return extremal.cost
    share = np.linspace(0.0, 1.0, _CUT_SAMPLES + 1)
    begin, end = extremal.times[near], extremal.times[near + 1]
    times = begin[:, None] + (end - begin)[:, None] * share
    physical = np.minimum(times.ravel() * problem.duration, trajectory.duration)
    q = so3.quaternion_multiply(trajectory.evaluate_quaternion(physical)[0], setup.body)
    hidden = rounding(setup.table, crossing[:, near], times, q.reshape(*times.shape, 4))
    trapezoids = 0.5 * (hidden[:, 1:] + hidden[:, :-1]).sum(axis=1) * (end - begin) / _CUT_SAMPLES
    return extremal.cost + 0.5 * float(trapezoids.sum())


def published(problem: Problem, setup: Setup, extremal: Extremal) -> Trajectory:
    """The trajectory of an extremal, in the user's time and body axes."""
    return _trajectory(problem, setup, extremal.times, extremal.states)


def _without_roll(
    problem: Problem, setup: Setup, extremal: Extremal, trajectory: Trajectory
) -> Trajectory:
    """On S^2 a trajectory with samples so dense that the quintics between them hardly roll.

    Whoever goes on from within them begins without roll about the boresight, and must not jump.
    """
    times, states = extremal.times, extremal.states
    for _ in range(_MOST_DOUBLINGS):
        inside = trajectory.times[:-1] + _ROLLS_AT[:, None] * np.diff(trajectory.times)
        rates = trajectory.evaluate_quaternion(inside.ravel())[1]
        rolling = np.abs(rates @ problem.boresight).reshape(inside.shape).max(axis=0) > _MOST_ROLL
        if not rolling.any():
            break
        times, states = _denser(setup, times, states, rolling)
        trajectory = _trajectory(problem, setup, times, states)
    return trajectory


def _denser(
    setup: Setup, times: Array, states: Array, where: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Samples of an extremal, and those half-way to the next ones `where` (n - 1,)."""
    n = times.size - 1
    middles, costs, interpolation = np.empty((n, 13)), np.empty(n), np.empty(n)
    shooting.measure(
        setup.pointing, setup.table, setup.sigma, times, np.ascontiguousarray(states),
        np.empty((n, 12)), middles, costs, interpolation,
    )  # fmt: skip
    after = np.flatnonzero(where) + 1
    half = 0.5 * (times[after] + times[after - 1])
    return np.insert(times, after, half), np.insert(states, after, middles[where], axis=0)


def _trajectory(problem: Problem, setup: Setup, times: Array, states: Array) -> Trajectory:
    T = problem.duration
    q, v, a = states[:, :4], states[:, 4:7] / T, states[:, 7:10] / T**2
    if setup.pointing or setup.free_roll:
        back = so3.quaternion_to_matrix(setup.body).T
        q = so3.quaternion_multiply(q, so3.quaternion_conjugate(setup.body))
        v, a = v @ back, a @ back
    # Neighbours of opposite sign are the same turn: keep the sign continuous.
    flips = np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0
    if flips.any():
        signs = np.cumprod(np.where(flips, -1.0, 1.0))
        q = np.concatenate([q[:1], signs[:, None] * q[1:]])
    times = times * T
    times[-1] = T
    return Trajectory(times, q, v, a)
