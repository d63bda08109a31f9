# SPDX-License-Identifier: Apache-2.0
"""solve(): the best certified answer on whole case files, its statuses, and its symmetries."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from benchmark.cases import load, problem_of
from benchmark.cost import faults, trajectory_cost
from benchmark.hard import judged
from benchmark.hard_cases import makers, sealed
from benchmark.random_cases import random_cases, random_direction
from riem_planner import (
    S2,
    SO3,
    OrientationObstacle,
    PlanningError,
    Problem,
    State,
    Status,
    Trajectory,
    Zone,
    certify,
    plan,
    solve,
)
from riem_planner.geometry import so3, sphere
from riem_planner.solve import _is_minimum, _stated_cost, published, solve_many
from riem_planner.solver.extremal import INTERVAL, extremal_near
from riem_planner.solver.setup import set_up
from riem_planner.solver.watch import StopFlag, Watch

SEED = 72
KINDS = ("so3", "s2", "cones")
TIMES = np.linspace(0.0, 1.0, 101)


@pytest.fixture(scope="module")
def solved():
    """Cases, problems and solutions of whole case files, each solved once."""
    kept = {}

    def answers(name):
        if name not in kept:
            cases = load(name)
            problems = [problem_of(case) for case in cases]
            kept[name] = cases, problems, solve_many(problems)
        return kept[name]

    return answers


def attitudes(solution, problem, times=TIMES):
    return solution.trajectory.evaluate(times * problem.duration)[0]


def distances(first, second, space, boresight=(1.0, 0.0, 0.0)):
    """Between attitudes (n, 3, 3) [rad], on S^2 between their directions."""
    if space is S2:
        return sphere.angle(first @ np.asarray(boresight), second @ np.asarray(boresight))
    return so3.distance(first, second)


# The case files


def test_textbook_problems_are_solved_at_the_best_known_cost(solved):
    for case, _, solution in zip(*solved("textbook"), strict=True):
        assert solution.status is Status.SOLVED
        assert solution.certificate.certified
        assert solution.converged
        assert solution.local_minimum
        assert solution.cost <= case["best_known_cost"] * (1.0 + 1e-6)


@pytest.mark.parametrize("name", ["random-so3", "random-s2", "random-cones"])
def test_random_problems_are_all_certified_and_hardly_ever_costlier_than_the_best(solved, name):
    cases, _, solutions = solved(name)
    assert [s.message for s in solutions if not s.solved] == []
    assert all(s.certificate.certified and s.converged for s in solutions)
    best = np.array([case["best_known_cost"] for case in cases])
    excess = np.array([s.cost for s in solutions]) / best - 1.0
    assert np.mean(excess <= 1e-3) >= 0.99
    assert np.mean(excess <= 1e-5) >= 0.99


@pytest.mark.parametrize("name", ["textbook", "random-so3", "random-s2", "random-cones"])
def test_answers_stand_a_check_that_is_not_the_certificate(solved, name):
    for _, problem, solution in zip(*(part[::4] for part in solved(name)), strict=True):
        assert faults(problem, solution.trajectory) == []
        cost = trajectory_cost(problem, solution.trajectory)
        assert cost == pytest.approx(solution.cost, rel=1e-6)


@pytest.mark.parametrize("name", ["textbook", "random-so3", "random-s2", "random-cones"])
def test_true_errors_are_within_the_tolerance_and_the_estimates(solved, name):
    for _, problem, solution in zip(*solved(name), strict=True):
        # The same extremal on a mesh four times finer.
        setup, times = set_up(problem), np.linspace(0.0, 1.0, 201)
        q = solution.trajectory.evaluate_quaternion(times * problem.duration)[0]
        q = so3.quaternion_multiply(q, setup.body)
        finer = extremal_near(setup, times, q, 1e-8, Watch(None, None), 0.25 * INTERVAL)
        trajectory = published(problem, setup, finer)
        times = np.linspace(0.0, problem.duration, 1001)
        ours, theirs = (t.evaluate(times)[0] for t in (solution.trajectory, trajectory))
        apart = distances(ours, theirs, problem.space, problem.boresight).max()
        assert apart <= 1e-8
        assert apart <= solution.trajectory_error + finer.error + 1e-12
        cost = _stated_cost(problem, setup, finer, trajectory) / problem.duration**3
        assert solution.cost == pytest.approx(cost, rel=1e-8)


def test_alternatives_are_certified_other_costlier_and_in_order(solved):
    several = 0
    for name in ("random-so3", "random-s2", "random-cones"):
        for _, problem, solution in zip(*(part[::5] for part in solved(name)), strict=True):
            costs = [solution.cost, *(a.cost for a in solution.alternatives)]
            assert costs == sorted(costs)
            several += len(costs) > 1
            for other in solution.alternatives:
                certificate = certify(other.trajectory, problem)
                assert certificate.certified
                assert other.clearance == certificate.clearance
                assert trajectory_cost(problem, other.trajectory) == pytest.approx(
                    other.cost, rel=1e-6
                )
                R = other.trajectory.evaluate(TIMES * problem.duration)[0]
                apart = distances(R, attitudes(solution, problem), SO3)
                assert apart.max() > 1e-3
    assert several > 20


@pytest.mark.parametrize("kind", KINDS)
def test_the_published_ends_are_the_stated_ones(kind):
    for case in random_cases(kind, SEED, 10):
        problem = problem_of(case)
        trajectory = solve(problem).trajectory
        assert trajectory.duration == problem.duration
        for t, state in ((0.0, problem.start), (problem.duration, problem.goal)):
            R, v, _ = trajectory.evaluate(t)
            b = problem.boresight
            if problem.space is S2:
                wanted = state.orientation @ np.cross(state.angular_velocity, b)
                np.testing.assert_allclose(R @ b, state.orientation @ b, atol=1e-12)
                np.testing.assert_allclose(R @ np.cross(v, b), wanted, atol=1e-11)
            else:
                np.testing.assert_allclose(R, state.orientation, atol=1e-13)
                np.testing.assert_allclose(v, state.angular_velocity, atol=1e-12)


def test_a_pointing_trajectory_never_rolls():
    problem = problem_of(random_cases("s2", SEED, 1)[0])
    trajectory = solve(problem).trajectory
    _, v, a = trajectory.evaluate(TIMES * problem.duration)
    # At the samples to rounding; between them the interpolant is as near as its tolerance.
    at_samples = trajectory.angular_velocities @ problem.boresight
    np.testing.assert_allclose(at_samples, 0.0, atol=1e-14)
    assert np.abs(v @ problem.boresight).max() < 1e-6 * np.abs(v).max()
    assert np.abs(a @ problem.boresight).max() < 1e-4 * np.abs(a).max()


# Hard sets


@pytest.mark.parametrize(
    "name", [name for name in makers() if name not in ("sealed", "zones 60 %", "50 obstacles")]
)
def test_hard_problems_are_certified_and_right(name):
    make = makers()[name]
    cases = [make(index) for index in range(8)]
    for case, solution in zip(cases, solve_many(map(problem_of, cases)), strict=True):
        assert solution.solved, (case["name"], solution.message)
        assert judged(case, solution) == []


# In the last two a path over a grid is clear, and a descent on softer potentials loses it.
@pytest.mark.parametrize(
    ("name", "indices"), [("50 obstacles", (0, 1)), ("zones 60 %", (0, 1, 2, 3, 58, 99))]
)
def test_clutter_is_solved_and_right(name, indices):
    make = makers()[name]
    cases = [make(index) for index in indices]
    for case, solution in zip(cases, solve_many(map(problem_of, cases)), strict=True):
        assert solution.solved, (case["name"], solution.message)
        assert judged(case, solution) == []


# Statuses


def test_a_sealed_goal_is_refused_within_the_deadline():
    begin = time.monotonic()
    solution = solve(problem_of(sealed(0)), deadline=20.0)
    assert time.monotonic() - begin < 20.0
    assert solution.status is Status.NO_CERTIFIED_TRAJECTORY
    assert solution.trajectory is None
    assert "no certified trajectory" in solution.message
    assert solution.status.advice in solution.message


@pytest.mark.parametrize("deadline", [0.0, 1e-4, 0.05])
def test_a_deadline_is_honoured_within_an_iteration(deadline):
    problem = problem_of(makers()["50 obstacles"](1))
    begin = time.monotonic()
    solution = solve(problem, deadline=deadline)
    # One iteration with 50 obstacles takes a millisecond, the rest is for a busy machine.
    assert time.monotonic() - begin < deadline + 0.1
    assert solution.status is Status.OUT_OF_TIME
    assert solution.trajectory is None
    assert "deadline" in solution.message


def test_an_ample_deadline_changes_nothing():
    problem = problem_of(load("random-cones")[0])
    assert_same_bits(solve(problem), solve(problem, deadline=60.0, should_stop=lambda: False))


def test_a_withdrawn_request_ends_at_once():
    solution = solve(problem_of(load("random-so3")[0]), should_stop=lambda: True)
    assert solution.status is Status.CANCELLED
    assert solution.trajectory is None
    assert solution.iterations <= 1


def test_should_stop_is_asked_between_iterations_and_obeyed():
    problem = problem_of(load("random-so3")[0])
    asked = 0

    def count():
        nonlocal asked
        asked += 1
        return False

    whole = solve(problem, should_stop=count)
    assert whole.solved
    assert asked >= whole.iterations
    total, asked = asked, 0

    def stop_half_way():
        count()
        return asked >= total // 2

    solution = solve(problem, should_stop=stop_half_way)
    assert solution.status is Status.CANCELLED
    assert asked == total // 2
    assert 0 < solution.iterations < whole.iterations


def test_a_stop_from_another_thread_ends_a_long_solve():
    stop = threading.Event()
    timer = threading.Timer(0.05, stop.set)
    timer.start()
    begin = time.monotonic()
    solution = solve(problem_of(makers()["50 obstacles"](1)), should_stop=stop.is_set)
    assert time.monotonic() - begin < 0.3
    assert solution.status is Status.CANCELLED


def test_on_s2_it_hardly_rolls_between_the_samples_either():
    for case in load("random-s2")[:20]:
        problem = problem_of(case)
        trajectory = solve(problem).trajectory
        rates = trajectory.evaluate_quaternion(np.linspace(0.0, problem.duration, 2001))[1]
        # What goes on from within it without roll, as the node does, jumps by less than 1e-9.
        assert np.abs(rates @ problem.boresight).max() < 1e-9, case["name"]


def test_a_stop_flag_is_seen_by_compiled_code():
    problem = problem_of(makers()["50 obstacles"](1))
    assert_same_bits(solve(problem), solve(problem, should_stop=StopFlag()))
    whole = solve(problem, should_stop=StopFlag())
    stop = StopFlag()
    timer = threading.Timer(0.3 * whole.solve_time, stop.set)
    timer.start()
    solution = solve(problem, should_stop=stop)
    assert solution.status is Status.CANCELLED
    assert 0 < solution.iterations < whole.iterations
    stop = StopFlag()
    stop.set()
    assert solve(problem, should_stop=stop).iterations <= 1


def test_how_long_compiled_code_runs_before_the_next_look():
    assert Watch(None, None).stride == Watch(None, StopFlag()).stride > 100
    assert Watch(60.0, lambda: False).stride == 1
    timed = Watch(60.0, StopFlag())
    assert timed.stride == 1  # until it is known how long an iteration takes
    time.sleep(0.01)
    timed.count(1000)
    assert 2 <= timed.stride <= 51  # half a millisecond at a hundredth of one, or slower


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_ends_in_a_zone_are_told_with_zone_and_depth(space):
    start, goal = State.from_direction([1.0, 0.0, 0.0]), State.from_direction([0.0, 1.0, 0.0])
    at_start = Zone([1.0, 0.1, 0.0], 0.2, strength=0.1, name="sun")
    at_goal = Zone([0.1, 1.0, 0.0], 0.2, strength=0.1, name="moon")
    away = Zone([0.0, 1.0, 0.0], 1.0, kind="keep_in", strength=0.1, name="earth")
    depth = f"{np.degrees(0.2 - np.arctan(0.1)):.4g} degrees"
    for zone, status, key in (
        (at_start, Status.START_IN_ZONE, "start"),
        (at_goal, Status.GOAL_IN_ZONE, "goal"),
        (away, Status.START_IN_ZONE, "start"),
    ):
        solution = solve(Problem(start, goal, 2.0, space, obstacles=(zone,)))
        assert solution.status is status
        assert solution.trajectory is None
        for part in (key, zone.name, depth if zone is not away else "32.7", status.advice):
            assert part in solution.message


def test_plan_returns_the_trajectory_or_raises_with_the_solution():
    problem = turn(1.0)
    assert plan(problem).duration == 1.0
    zone = Zone([1.0, 0.0, 0.0], 0.2, strength=0.1)
    with pytest.raises(PlanningError) as error:
        plan(replace(problem, obstacles=(zone,)))
    assert error.value.solution.status is Status.START_IN_ZONE


def test_a_moving_zone_counts_where_it_is_at_each_end():
    start, goal = State.from_direction([0.0, 0.0, 1.0]), State.from_direction([0.0, 1.0, 0.0])
    moving = {"half_angle": 0.2, "strength": 0.01, "rate": [0.0, 0.0, np.pi / 4]}
    leaves, comes = Zone([0.0, 1.0, 0.0], **moving), Zone([1.0, 0.0, 0.0], **moving)
    assert solve(Problem(start, goal, 2.0, obstacles=(leaves,))).solved
    assert solve(Problem(start, goal, 2.0, obstacles=(comes,))).status is Status.GOAL_IN_ZONE


# The same input, the same bits


def assert_same_bits(first, second):
    for key in ("status", "cost", "trajectory_error", "cost_error", "local_minimum", "iterations"):
        assert getattr(first, key) == getattr(second, key), key
    for a, b in zip((first, *first.alternatives), (second, *second.alternatives), strict=True):
        assert a.cost == b.cost
        for key in ("times", "quaternions_xyzw", "angular_velocities", "angular_accelerations"):
            np.testing.assert_array_equal(getattr(a.trajectory, key), getattr(b.trajectory, key))


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_problem_gives_the_same_bits_alone_and_in_a_batch(kind):
    problems = [problem_of(case) for case in random_cases(kind, SEED, 12)]
    batch = solve_many(problems, jobs=2)
    for problem, solution in zip(problems, batch, strict=True):
        again = solve(problem)
        assert_same_bits(again, solution)
        assert_same_bits(again, solve(problem))


# Symmetries


@pytest.mark.parametrize("kind", KINDS)
def test_turning_the_whole_problem_turns_the_answer(kind):
    G = so3.exp([0.7, -1.9, 0.4])
    for case in random_cases(kind, SEED, 6):
        problem = problem_of(case)
        turned = replace(
            problem,
            start=State(G @ problem.start.orientation, problem.start.angular_velocity),
            goal=State(G @ problem.goal.orientation, problem.goal.angular_velocity),
            obstacles=tuple(
                replace(o, orientation=G @ o.orientation)
                if isinstance(o, OrientationObstacle)
                else replace(o, direction=G @ o.direction)
                for o in problem.obstacles
            ),
        )
        first, second = solve(problem), solve(turned)
        assert second.cost == pytest.approx(first.cost, rel=2e-8)
        apart = so3.distance(G @ attitudes(first, problem), attitudes(second, turned))
        assert apart.max() < 5e-8


def scaled(problem, factor):
    return replace(
        problem,
        start=State(problem.start.orientation, problem.start.angular_velocity / factor),
        goal=State(problem.goal.orientation, problem.goal.angular_velocity / factor),
        duration=problem.duration * factor,
        tension=problem.tension / factor**2,
        obstacles=tuple(replace(o, strength=o.strength / factor**4) for o in problem.obstacles),
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("factor", [100.0, 0.01])
def test_scaling_time_leaves_the_path_the_same(kind, factor):
    for case in random_cases(kind, SEED, 4):
        problem = problem_of(case)
        other = scaled(problem, factor)
        first, second = solve(problem), solve(other)
        assert second.cost * factor**3 == pytest.approx(first.cost, rel=2e-8)
        apart = so3.distance(attitudes(first, problem), attitudes(second, other))
        assert apart.max() < 5e-8
        v = [s.trajectory.evaluate(TIMES * s.trajectory.duration)[1] for s in (first, second)]
        np.testing.assert_allclose(v[1] * factor, v[0], atol=1e-6 * np.abs(v[0]).max())


def test_normalised_strength_and_tension_are_the_physical_ones_of_the_duration():
    problem = problem_of(random_cases("so3", SEED, 1)[0])
    T = problem.duration
    normalised = replace(
        problem,
        tension=None,
        normalized_tension=problem.tension * T**2,
        obstacles=tuple(
            replace(o, strength=None, normalized_strength=o.strength * T**4)
            for o in problem.obstacles
        ),
    )
    first, second = solve(problem), solve(normalised)
    assert second.cost == pytest.approx(first.cost, rel=1e-9)
    assert so3.distance(attitudes(first, problem), attitudes(second, problem)).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_reversing_time_reverses_the_answer(kind):
    for case in random_cases(kind, SEED, 6):
        problem = problem_of(case)
        back = replace(
            problem,
            start=State(problem.goal.orientation, -problem.goal.angular_velocity),
            goal=State(problem.start.orientation, -problem.start.angular_velocity),
        )
        first, second = solve(problem), solve(back)
        assert second.cost == pytest.approx(first.cost, rel=2e-8)
        apart = distances(attitudes(first, problem)[::-1], attitudes(second, back), problem.space)
        assert apart.max() < 5e-8


# Classes of paths


def turn(angle):
    return Problem(State(np.eye(3)), State(so3.exp([0.0, 0.0, angle])), 1.0)


def test_both_ways_round_are_reported():
    solution = solve(turn(2.8))
    assert solution.cost == pytest.approx(6.0 * 2.8**2, rel=1e-8)
    costs = [other.cost for other in solution.alternatives]
    assert any(cost == pytest.approx(6.0 * (2 * np.pi - 2.8) ** 2, rel=1e-8) for cost in costs)
    assert so3.log(solution.trajectory.evaluate(0.5)[0])[2] == pytest.approx(1.4, abs=1e-8)


def test_rest_to_rest_about_one_axis_is_the_hermite_cubic():
    problem = turn(2.4)
    angle = so3.log(attitudes(solve(problem), problem))
    np.testing.assert_allclose(angle[:, 2], 2.4 * TIMES**2 * (3 - 2 * TIMES), atol=1e-8)
    np.testing.assert_allclose(angle[:, :2], 0.0, atol=1e-12)


def test_the_long_way_round_is_taken_where_the_short_one_costs_more():
    wall = OrientationObstacle(so3.exp([0.0, 0.0, 1.4]), strength=20.0, range=(1.0, 1.6))
    problem = replace(turn(2.8), obstacles=(wall,))
    solution = solve(problem)
    middle = so3.log(solution.trajectory.evaluate(0.5)[0])
    assert middle[2] == pytest.approx(1.4 - np.pi, abs=0.1)
    assert solution.cost < min(other.cost for other in solution.alternatives)


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_both_sides_of_an_obstacle_on_the_straight_slew_are_reported(space):
    start, goal = State.from_direction([1.0, 0.0, 0.0]), State.from_direction([0.0, 1.0, 0.0])
    zone = Zone([1.0, 1.0, 0.0], 0.1, normalized_strength=0.5)
    problem = Problem(start, goal, 3.0, space, obstacles=(zone,))
    solution = solve(problem)
    best = solution.trajectory.evaluate(1.5)[0][2, 0]
    others = [
        other.trajectory.evaluate(1.5)[0][2, 0]
        for other in solution.alternatives
        if other.cost == pytest.approx(solution.cost, rel=1e-6)
    ]
    # Mirror images have one cost: either may be called the best, and both are worth telling.
    found = any(side == pytest.approx(-best, abs=1e-6) for side in others)
    assert abs(best) > 0.1
    assert solution.local_minimum
    assert found or not others


@pytest.mark.parametrize(("angle", "place", "radius"), [(1.4, 0.7, 0.0), (2.8, 1.4, 0.2)])
def test_one_of_a_family_of_ways_round_an_obstacle_on_the_axis_is_solved_to_tolerance(
    angle, place, radius
):
    # Turned about the axis it is another one of the same cost: the equations are singular.
    obstacle = OrientationObstacle(so3.exp([0.0, 0.0, place]), strength=0.05, radius=radius)
    problem = replace(turn(angle), obstacles=(obstacle,))
    solution = solve(problem)
    assert solution.converged
    assert max(solution.trajectory_error, solution.cost_error) < 1e-8
    turned = so3.exp([0.0, 0.0, 2.0])
    R = solution.trajectory.evaluate(np.array([0.5]))[0][0]
    other = so3.log(turned @ R @ turned.T)
    assert np.linalg.norm(other - so3.log(R)) > 0.05  # it does go round


def test_an_obstacle_that_appears_on_the_path_is_gone_round_at_once():
    # Nearly a family of ways of one cost: only the rate across the slew tells them apart.
    rng = np.random.default_rng(0)
    undetermined = 0
    for k in range(80):
        end = rng.uniform(0.8, 2.0) * random_direction(rng)
        start = State(np.eye(3), 0.02 * rng.normal(size=3))
        flying = solve(Problem(start, State(so3.exp(end)), 10.0)).trajectory
        begin = 0.65
        (R, middle), (v, _), _ = flying.evaluate([begin, 0.5 * (begin + 10.0)])
        obstacle = OrientationObstacle(middle, normalized_strength=0.01, radius=0.1)
        goal = State(so3.exp(end))
        problem = Problem(State(R, v), goal, 10.0 - begin, obstacles=(obstacle,))
        times = np.linspace(begin, 10.0, 60)
        rest = Trajectory(times - begin, *flying.evaluate_quaternion(times))
        solution = solve(problem, warm_start=rest, search="local")
        assert solution.solved, (k, solution.message)
        price = trajectory_cost(problem, solution.trajectory)
        error = max(solution.cost_error, 1e-7)
        assert price == pytest.approx(solution.cost, rel=error)
        if not solution.converged:
            undetermined += 1
            assert solution.trajectory_error == np.inf
            assert solution.cost_error < 1e-3
            assert "many ways" in solution.message
            best = solve(problem)
            assert solution.cost < best.cost * (1.0 + 1e-3)
    assert 0 < undetermined < 40


def test_the_antipode_is_reached_on_the_sphere_and_not_mistaken():
    start, goal = State.from_direction([1.0, 0.0, 0.0]), State.from_direction([-1.0, 0.0, 0.0])
    problem = Problem(start, goal, 2.0, S2)
    solution = solve(problem)
    assert solution.solved
    np.testing.assert_allclose(solution.trajectory.evaluate(2.0)[0][:, 0], [-1, 0, 0], atol=1e-12)
    assert solution.cost == pytest.approx(6.0 * np.pi**2 / 8.0, rel=1e-8)
    stay = solve(Problem(start, start, 2.0, S2, obstacles=(Zone([0, 1, 0], 0.3, strength=0.1),)))
    np.testing.assert_allclose(stay.trajectory.evaluate(2.0)[0][:, 0], [1, 0, 0], atol=1e-12)
    assert stay.cost < 1.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_warm_start_stays_in_its_class(kind):
    compared = 0
    for case in random_cases(kind, SEED, 12):
        problem = problem_of(case)
        solution = solve(problem)
        for other in (solution, *solution.alternatives):
            again = solve(problem, warm_start=other.trajectory, search="local")
            assert again.solved
            R = other.trajectory.evaluate(TIMES * problem.duration)[0]
            apart = so3.distance(R, attitudes(again, problem)).max()
            stayed = apart < 1e-6 and again.cost == pytest.approx(other.cost, rel=1e-7)
            # What is not a minimum may be left, for a cheaper one.
            assert stayed or again.cost < other.cost
            compared += stayed
    assert compared >= 18


def test_a_warm_start_of_a_moved_problem_is_its_own_answer():
    problem = problem_of(load("textbook")[0])
    flying = solve(problem).trajectory
    goal = State(problem.goal.orientation @ so3.exp([0.0, 0.02, 0.01]))
    moved = replace(problem, goal=goal)
    warm = solve(moved, warm_start=flying, search="local")
    assert warm.cost == pytest.approx(solve(moved).cost, rel=1e-8)
    assert so3.distance(warm.trajectory.evaluate(moved.duration)[0], goal.orientation) < 1e-12


def test_a_global_search_leaves_a_warm_start_for_a_better_class():
    problem = turn(2.8)
    solution = solve(problem)
    long_way = max(solution.alternatives, key=lambda other: other.cost).trajectory
    assert solve(problem, warm_start=long_way).cost == pytest.approx(solution.cost, rel=1e-9)
    local = solve(problem, warm_start=long_way, search="local")
    assert local.cost > 1.5 * solution.cost


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
@pytest.mark.parametrize("strength", [0.01, 1.0, 100.0])
def test_answers_keep_the_clearance_that_their_cost_demands(space, strength):
    middle, end = so3.exp([0.0, 0.0, 0.6]), so3.exp([0.0, 0.0, 1.2])
    point = (
        Zone(middle[:, 0], 0.0, strength=strength)
        if space is S2
        else OrientationObstacle(middle, strength=strength)
    )
    problem = Problem(State(np.eye(3)), State(end), 1.0, space, obstacles=(point,))
    solution = solve(problem)
    B = 0.5 * np.sqrt(2.0 * solution.cost)
    demanded = 0.5 * (np.sqrt(B**2 + strength / solution.cost) - B)
    (kept,) = solution.certificate.clearance.values()
    assert 0.0 < demanded < kept


# Local minimum


@pytest.mark.parametrize(
    ("a", "sigma", "last"), [(1, 5, 4.069355175139395), (1, 2, 4.7300407448627)]
)
@pytest.mark.parametrize(
    "space",
    [
        SO3,
        S2,
    ],
    ids=["so3", "s2"],
)
def test_an_extremal_is_told_a_minimum_just_until_its_biconjugate_time(space, a, sigma, last):
    rate = np.array([0.0, 0.0, a if space is S2 else 2.0 * a])
    for share, minimum in ((0.99, True), (1.01, False)):
        T = share * last
        goal = State(so3.exp(rate * T), rate)
        setup = set_up(Problem(State(np.eye(3), rate), goal, T, space, tension=sigma))
        times = np.linspace(0.0, 1.0, 41)
        q = so3.quaternion_multiply(so3.quaternion_exp(times[:, None] * T * rate), setup.body)
        geodesic = extremal_near(setup, times, np.ascontiguousarray(q), 1e-8, Watch(None, None))
        assert geodesic.cost == pytest.approx(0.5 * sigma * T**2 * (rate @ rate) * T**2, rel=1e-9)
        assert _is_minimum(setup, geodesic) is minimum


# The cut locus


def test_a_path_through_a_cut_locus_is_noted_and_a_range_removes_the_note():
    far = so3.exp([0.0, 0.0, np.pi + 0.6])
    start, goal = State(np.eye(3)), State(so3.exp([0.0, 0.0, 1.2]))
    plain = OrientationObstacle(far, normalized_strength=1.0)
    noted = solve(Problem(start, goal, 1.0, obstacles=(plain,)))
    assert noted.solved
    assert any("cut locus" in note for note in noted.notes)
    assert "cut locus" in noted.message
    tapered = replace(plain, range=(1.0, 2.5))
    assert solve(Problem(start, goal, 1.0, obstacles=(tapered,))).notes == ()
