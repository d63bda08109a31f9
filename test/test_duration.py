"""The least duration within limits, and the refusal of a shorter one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from riem_planner import S2, Limits, OrientationObstacle, Problem, State, Status, Zone, solve
from riem_planner.duration import least_duration
from riem_planner.geometry import so3

J = np.array([[2.0, 0.1, 0.05], [0.1, 3.0, 0.2], [0.05, 0.2, 4.0]])
PRINCIPAL = np.diag([2.0, 3.0, 4.0])
REST = State(np.eye(3))


def about_z(angle):
    return State(so3.exp([0.0, 0.0, angle]))


@pytest.mark.parametrize("angle", [0.05, 1.0, 2.5])
@pytest.mark.parametrize(
    ("limits", "binding", "exact"),
    [
        (Limits(rate=0.1), "rate", lambda x: 1.5 * x / 0.1),
        (Limits(acceleration=0.02), "acceleration", lambda x: math.sqrt(6.0 * x / 0.02)),
        (Limits(torque=0.03, inertia=PRINCIPAL), "torque", lambda x: math.sqrt(24.0 * x / 0.03)),
        (Limits(momentum=0.3, inertia=PRINCIPAL), "momentum", lambda x: 6.0 * x / 0.3),
        (Limits(momentum=[1e-3, 1e-3, 0.3], inertia=PRINCIPAL), "momentum", lambda x: 6 * x / 0.3),
    ],
)
def test_about_a_principal_axis_it_is_that_of_the_cubic(angle, limits, binding, exact):
    solution = solve(Problem(REST, about_z(angle), "auto", limits=limits))
    assert solution.solved
    assert solution.trajectory.duration == pytest.approx(exact(angle), rel=1e-3)
    assert f"bound by limits.{binding}" in solution.message
    assert 0.0 <= solution.certificate.limit_margins[binding] < 2e-3


def test_the_slowest_limit_binds():
    limits = Limits(rate=0.1, acceleration=0.01)
    quick = solve(Problem(REST, about_z(0.2), "auto", limits=limits))
    slow = solve(Problem(REST, about_z(3.0), "auto", limits=limits))
    assert "bound by limits.acceleration" in quick.message
    assert "bound by limits.rate" in slow.message
    assert set(slow.certificate.limit_margins) == {"rate", "acceleration"}


@pytest.mark.parametrize("part", [0.5, 0.98])
def test_a_duration_that_breaks_a_limit_is_refused_with_the_least_that_does_not(part):
    least = 1.5 * 2.0 / 0.1
    problem = Problem(REST, about_z(2.0), part * least, limits=Limits(rate=0.1))
    solution = solve(problem)
    assert solution.status is Status.LIMITS_EXCEEDED
    assert solution.trajectory is None
    assert solution.certificate.breaks_only_limits
    assert "limits.rate" in solution.message
    stated = float(solution.message.split("the least duration within the limits is ")[1].split()[0])
    assert stated == pytest.approx(least, rel=1e-3)
    assert solve(replace(problem, duration=stated)).solved


def test_a_duration_within_the_limits_is_kept():
    solution = solve(Problem(REST, about_z(2.0), 31.0, limits=Limits(rate=0.1)))
    assert solution.solved
    assert solution.trajectory.duration == 31.0
    assert solution.certificate.limit_margins["rate"] == pytest.approx(1.0 - 30.0 / 31.0, abs=2e-4)


def random_problem(seed, kind):
    """Kind 0 scales with the duration; 1 starts and ends turning; 2 has fixed strengths and
    tension; 3 has moving zones and ends turning.
    """
    rng = np.random.default_rng(1000 * kind + seed)
    q = rng.normal(size=(2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    v = rng.normal(size=(2, 3)) * (0.01 if kind in (1, 3) else 0.0)
    zones = []
    for _ in range(rng.integers(0, 3)):
        strength = {"normalized_strength": 0.01}
        if kind == 2:
            strength = {"strength": 10 ** rng.uniform(-8, -5)}
        zone = Zone(
            rng.normal(size=3),
            rng.uniform(0.1, 0.5),
            rng.normal(size=3),
            rate=rng.normal(size=3) * (1e-3 if kind == 3 else 0.0),
            **strength,
        )
        ends = [so3.quaternion_to_matrix(each) for each in q]
        if all(zone.distance(R) > zone.half_angle + 0.1 for R in ends):
            zones.append(zone)
    values = {"rate": 0.1, "acceleration": 0.01, "torque": 0.03, "momentum": 0.3}
    kept = [key for key in values if rng.random() < 0.6] or ["torque"]
    spread = rng.uniform(0.5, 1.5, 3) if rng.random() < 0.4 else 1.0
    return Problem(
        State.from_quaternion_xyzw(q[0], v[0]),
        State.from_quaternion_xyzw(q[1], v[1]),
        "auto",
        obstacles=tuple(zones),
        limits=Limits(**{key: values[key] * spread for key in kept}, inertia=J),
        tension=1e-4 if kind == 2 else None,
    )


def keeps_limits_at(problem, T):
    """Whether any slew of duration T that is found keeps the limits at 500 points."""
    solution = solve(replace(problem, duration=T, limits=None))
    if solution.trajectory is None:
        return False
    found = [solution.trajectory, *(other.trajectory for other in solution.alternatives)]
    times = np.linspace(0.0, T, 500)
    motions = [trajectory.evaluate(times)[1:] for trajectory in found]
    return any(max(problem.limits.used(*motion).values()) <= 1.0 for motion in motions)


def agrees_with_a_scan(problem, finest):
    solution = solve(problem)
    T = solution.trajectory.duration
    assert solution.certificate.certified
    assert min(solution.certificate.limit_margins.values()) >= 0.0
    below = T * np.exp(-np.arange(1, 101) * finest)[::-1]
    shorter = [t for t in below if keeps_limits_at(problem, t)]
    assert all(t > 0.99 * T for t in shorter), (T, shorter)


@pytest.mark.parametrize("kind", range(4))
@pytest.mark.parametrize("seed", range(3))
def test_no_duration_a_scan_finds_is_shorter(kind, seed):
    agrees_with_a_scan(random_problem(seed, kind), 0.005)


def least_is_sharp(problem):
    solution = solve(problem)
    T = solution.trajectory.duration
    assert solution.solved
    assert 0.0 <= min(solution.certificate.limit_margins.values()) < 0.02
    assert solve(replace(problem, duration=0.99 * T)).status is Status.LIMITS_EXCEEDED
    return T


def test_with_tension_the_path_depends_on_the_duration():
    # Tension flattens the rate, so the least duration is below the cubic's.
    problem = Problem(REST, about_z(2.0), "auto", tension=0.05, limits=Limits(rate=0.1))
    assert 20.0 < least_is_sharp(problem) < 0.9 * 30.0


def test_with_a_moving_zone_the_path_depends_on_the_duration():
    # How far the zone has come when the boresight passes decides how wide the detour is, and
    # the slow axis y how long that takes.
    zone = Zone(
        [0.5, 0.8, 0.1], 0.3, [1.0, 0.0, 0.0], normalized_strength=0.01, rate=[0.0, 0.0, -0.01]
    )
    limits = Limits(rate=[0.1, 0.01, 0.1])
    least_is_sharp(Problem(REST, about_z(2.0), "auto", obstacles=(zone,), limits=limits))


def test_a_costlier_class_of_paths_may_be_the_quicker_one():
    # The cheap way round the zone turns about the slow axis x, the long way round does not.
    zone = Zone([math.cos(1.3), math.sin(1.3), 0.1], 0.5, [1.0, 0.0, 0.0], normalized_strength=0.3)
    limits = Limits(rate=[0.002, 0.1, 0.1])
    problem = Problem(REST, about_z(2.6), "auto", obstacles=(zone,), limits=limits)
    long_way = 2.0 * math.pi - 2.6
    assert least_is_sharp(problem) == pytest.approx(1.5 * long_way / 0.1, rel=0.01)
    cheapest = solve(replace(problem, duration=100.0, limits=None)).trajectory
    assert np.max(np.abs(cheapest.angular_velocities[:, 0])) > 0.002


@pytest.mark.soak
def test_no_duration_a_scan_finds_is_shorter_on_100_problems():
    for seed in range(25):
        for kind in range(4):
            agrees_with_a_scan(random_problem(seed, kind), 0.005)


def test_on_s2_too():
    start = State.from_direction([1.0, 0.0, 0.0])
    goal = State.from_direction([-0.6, 0.8, 0.0])
    problem = Problem(start, goal, "auto", S2, limits=Limits(rate=0.05))
    angle = math.atan2(0.8, -0.6)
    assert solve(problem).trajectory.duration == pytest.approx(1.5 * angle / 0.05, rel=1e-3)
    zone = Zone([0.3, 0.9, 0.05], 0.3, normalized_strength=0.01, name="sun")
    detour = solve(replace(problem, obstacles=(zone,)))
    assert detour.solved
    assert detour.trajectory.duration > 1.01 * 1.5 * angle / 0.05
    antipode = replace(problem, goal=State.from_direction([-1.0, 0.0, 0.0]))
    assert solve(antipode).trajectory.duration == pytest.approx(1.5 * np.pi / 0.05, rel=1e-3)


def test_a_rate_at_an_end_beyond_the_limits_is_refused_for_every_duration():
    start = State(np.eye(3), [0.2, 0.0, 0.0])
    limits = Limits(rate=0.1)
    automatic = solve(Problem(start, about_z(1.0), "auto", limits=limits))
    assert automatic.status is Status.LIMITS_EXCEEDED
    assert "start.angular_velocity: 2 times limits.rate" in automatic.message
    fixed = solve(Problem(start, about_z(1.0), 50.0, limits=limits))
    assert fixed.status is Status.LIMITS_EXCEEDED
    assert "no duration helps" in fixed.message


def test_staying_where_one_is_has_no_least_duration():
    solution = solve(Problem(REST, REST, "auto", limits=Limits(rate=0.1)))
    assert solution.status is Status.LIMITS_EXCEEDED
    assert "any duration keeps the limits" in solution.message


def test_a_start_in_a_zone_is_that_with_any_duration():
    zone = Zone([1.0, 0.0, 0.0], 0.3, [1.0, 0.0, 0.0], strength=1.0, name="sun")
    for tension in (None, 1.0):
        problem = Problem(
            REST, about_z(1.0), "auto", obstacles=(zone,), limits=Limits(rate=0.1), tension=tension
        )
        assert solve(problem).status is Status.START_IN_ZONE
        durations = []

        def counted(each, near, durations=durations):
            durations.append(each.duration)
            return solve(each, warm_start=near)

        assert least_duration(problem, counted).failure.status is Status.START_IN_ZONE
        assert len(durations) == 1


def test_deadline_and_cancellation_are_kept_while_the_duration_is_searched():
    Q = so3.exp([0.2, 0.3, 0.5])
    problem = Problem(
        REST,
        about_z(1.5),
        "auto",
        obstacles=(OrientationObstacle(Q, strength=1e-6),),
        limits=Limits(rate=0.05),
    )
    assert solve(problem).solved
    assert solve(problem, deadline=1e-4).status is Status.OUT_OF_TIME
    assert solve(problem, should_stop=lambda: True).status is Status.CANCELLED
    calls = iter(range(10_000))
    late = solve(replace(problem, duration=20.0), should_stop=lambda: next(calls) > 60)
    assert late.status is Status.CANCELLED


def test_least_duration_without_limits_is_a_mistake():
    with pytest.raises(ValueError, match="needs limits"):
        least_duration(Problem(REST, about_z(1.0), 1.0), lambda problem, near: solve(problem))
