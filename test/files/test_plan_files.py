# SPDX-License-Identifier: Apache-2.0
"""Plan files: what `riem_plan` writes, and what its check of them finds."""

import copy
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from riem_planner.certificate import clearance_along
from riem_planner.errors import InvalidProblemError
from riem_planner.files.plan_files import (
    check_plan,
    encoded,
    parsed_plan,
    plan_document,
    planned_trajectory,
)
from riem_planner.files.problem_files import parse_problem, read_problem
from riem_planner.geometry import so3
from riem_planner.limits import Limits
from riem_planner.plots.straight import straight_slew
from riem_planner.riem_plan import planning
from riem_planner.riem_plan.planning import plan_problem
from riem_planner.solution import Solution, Status

ROOT = Path(__file__).resolve().parents[2]
LINES = (ROOT / "config/problems/textbook.jsonl").read_text(encoding="utf-8").splitlines()
KEYS = {
    "name", "status", "message", "cost", "duration", "times", "orientations_xyzw",
    "angular_velocities", "angular_accelerations", "clearance_deg", "certified", "local_minimum",
    "iterations", "solve_time_s", "alternatives",
}  # fmt: skip


@pytest.fixture(scope="module")
def problem():
    return parse_problem(json.loads(LINES[3]))


@pytest.fixture(scope="module")
def plan(problem):
    return plan_problem(problem)


@pytest.fixture
def document(plan):
    return parsed_plan(encoded(plan_document(plan)))


def test_plan_holds_every_promised_key(document):
    assert document.keys() >= KEYS
    assert document["certified"] is True
    assert document["status"] == "SOLVED"
    assert document["name"] == "P6"
    assert document["clearance_deg"].keys() == {"o1", "o2"}
    assert min(document["clearance_deg"].values()) > 0.0


def test_samples_are_even_and_end_at_the_duration(document):
    times = np.array(document["times"])
    assert times.size == 201
    assert (times[0], times[-1]) == (0.0, document["duration"])
    np.testing.assert_allclose(np.diff(times), times[-1] / 200, rtol=1e-9)
    for key, width in (
        ("orientations_xyzw", 4), ("angular_velocities", 3), ("angular_accelerations", 3),
    ):  # fmt: skip
        assert np.shape(document[key]) == (201, width)


def test_clearance_is_that_of_the_samples_and_a_true_lower_bound(problem, plan, document):
    times = np.linspace(0.0, problem.duration, 2001)
    margins = clearance_along(plan.trajectory, problem, times)
    for name, bound in document["clearance_deg"].items():
        least = math.degrees(margins[name].min())
        assert bound <= least
        assert bound == pytest.approx(least, abs=0.1)


def test_trajectory_survives_the_file_bit_for_bit(plan, document):
    back = planned_trajectory(document)
    np.testing.assert_array_equal(back.times, plan.trajectory.times)
    np.testing.assert_array_equal(back.quaternions_xyzw, plan.trajectory.quaternions_xyzw)
    np.testing.assert_array_equal(back.coefficients, plan.trajectory.coefficients)


def test_plan_states_its_own_problem(problem, document):
    own = parse_problem(document["problem"])
    R = so3.exp(np.array([0.4, 0.1, -0.7]))
    assert own.margins(R) == pytest.approx(problem.margins(R), abs=1e-14)
    assert own.duration == problem.duration


def test_number_of_samples_can_be_chosen(problem):
    assert plan_problem(problem, 301).trajectory.times.size == 301


def test_too_few_samples_are_raised_until_certified():
    # The slew turns by about a half turn, which two samples leave open the direction of.
    plan = plan_problem(read_problem(ROOT / "config/problems/bevo2_case0.yaml"), 2)
    assert plan.certified
    assert plan.trajectory.times.size == 3
    assert any("3 samples instead of 2" in note for note in plan.solution.notes)


def test_samples_too_few_for_the_path_are_noted(problem):
    assert any("leave the least-cost path" in n for n in plan_problem(problem, 3).solution.notes)
    assert not any("leave the" in note for note in plan_problem(problem).solution.notes)


def test_samples_that_cannot_be_certified_are_not_written_as_a_plan(problem, monkeypatch):
    refusal = replace(planning.certify(straight_slew(problem), problem))
    refusal = replace(refusal, certified=False, reasons=("o1: too close",))
    monkeypatch.setattr(planning, "certify", lambda *_, **__: refusal)
    plan = plan_problem(problem)
    document = parsed_plan(encoded(plan_document(plan)))
    assert not plan.certified
    assert document["certified"] is False
    assert document["status"] == "NO_CERTIFIED_TRAJECTORY"
    assert "o1: too close" in document["message"]
    assert document["times"] == []
    assert document["cost"] is None


def test_unsolved_problem_gives_a_plan_without_samples(problem, plan, monkeypatch):
    # Even if the solver handed over a trajectory that it calls unsolved.
    outcome = Solution(Status.OUT_OF_TIME, "out of time", trajectory=plan.trajectory)
    monkeypatch.setattr(planning, "solve", lambda *_, **__: outcome)
    document = parsed_plan(encoded(plan_document(plan_problem(problem))))
    assert (document["certified"], document["status"]) == (False, "OUT_OF_TIME")
    assert document["times"] == []
    assert document["clearance_deg"] == {}


def test_what_is_not_finite_is_null(plan):
    solution = replace(plan.solution, cost=math.nan, cost_error=math.inf)
    text = encoded(plan_document(replace(plan, solution=solution)))
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["cost"] is None


def test_untouched_plan_is_certified(problem, document):
    certificate, claims = check_plan(document, problem)
    assert certificate.certified
    assert claims == []
    for name, bound in document["clearance_deg"].items():
        assert math.degrees(certificate.clearance[name]) == pytest.approx(bound, abs=1e-9)


def bent(document):
    """One orientation in the middle turned by 5 degrees, rates as they were."""
    turn = so3.quaternion_exp(np.array([0.0, math.radians(5.0), 0.0]))
    rows = document["orientations_xyzw"]
    rows[100] = so3.quaternion_multiply(np.array(rows[100]), turn).tolist()


def shifted_goal(document):
    turn = so3.quaternion_exp(np.array([0.0, 1e-4, 0.0]))
    rows = document["orientations_xyzw"]
    rows[:] = [so3.quaternion_multiply(np.array(row), turn).tolist() for row in rows]


def cut_short(document):
    for key in ("times", "orientations_xyzw", "angular_velocities", "angular_accelerations"):
        del document[key][150:]


def scaled_quaternion(document):
    document["orientations_xyzw"][50] = [1.01 * x for x in document["orientations_xyzw"][50]]


def false_rate(document):
    document["angular_velocities"][120][1] += 5.0


@pytest.mark.parametrize("tamper", [bent, shifted_goal, cut_short, scaled_quaternion, false_rate])
def test_tampered_plan_is_refused(problem, document, tamper):
    tamper(document)
    certificate, _ = check_plan(document, problem)
    assert not certificate.certified
    assert certificate.reasons


def test_plan_through_a_zone_is_refused(problem, document):
    first, *others = problem.obstacles
    inside = planned_trajectory(document).evaluate(1.0)[0] @ first.boresight
    zone = replace(first, direction=inside, half_angle=0.1)
    certificate, _ = check_plan(document, replace(problem, obstacles=(zone, *others)))
    assert not certificate.certified
    assert any("o1" in reason for reason in certificate.reasons)


def test_plan_beyond_the_limits_is_refused(problem, document):
    fastest = planned_trajectory(document).angular_velocities
    most = float(np.max(np.linalg.norm(fastest, axis=1)))
    within, beyond = Limits(rate=1.01 * most), Limits(rate=0.99 * most)
    assert check_plan(document, replace(problem, limits=within))[0].certified
    certificate, _ = check_plan(document, replace(problem, limits=beyond))
    assert not certificate.certified
    assert any("rate" in reason for reason in certificate.reasons)


def test_least_duration_is_found_and_stated(problem):
    automatic = replace(
        problem,
        duration=math.inf,
        limits=Limits(rate=0.5),
        obstacles=tuple(
            replace(obstacle, strength=None, normalized_strength=0.01)
            for obstacle in problem.obstacles
        ),
    )
    plan = plan_problem(automatic)
    document = parsed_plan(encoded(plan_document(plan)))
    assert document["certified"]
    assert document["duration"] == document["times"][-1] == document["problem"]["duration"]
    assert plan.certificate.rate_bound == pytest.approx(0.5, rel=1e-3)
    assert 0.0 <= document["limits_left"]["rate"] < 2e-3
    # The problem as the user states it, its duration yet to be found, accepts the plan.
    assert check_plan(document, automatic)[0].certified


@pytest.mark.parametrize(
    ("claim", "word"),
    [({"o1": 90.0}, "claims 90.0"), ({"o3": 1.0}, "no such zone"), ({"o1": None}, "nothing")],
)
def test_claim_beyond_the_certificate_is_found(problem, document, claim, word):
    document["clearance_deg"] = claim
    _, claims = check_plan(document, problem)
    assert len(claims) == 1
    assert word in claims[0]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("times", [0.0, 1.0]),
        ("times", list(reversed(range(201)))),
        ("orientations_xyzw", "none"),
        ("orientations_xyzw", [[0, 0, 1]] * 201),
        ("angular_velocities", [[0, 0, None]] * 201),
        ("angular_accelerations", [[0, 0, 1], [0]]),
    ],
)
def test_samples_that_are_no_trajectory_are_named(document, key, value):
    document = copy.deepcopy(document)
    document[key] = value
    with pytest.raises(InvalidProblemError) as caught:
        planned_trajectory(parsed_plan(json.dumps(document)))
    assert caught.value.key in (key, "quaternions_xyzw", "angular_velocities")


def test_straight_slew_is_the_geodesic_from_rest_to_rest(problem):
    slew = straight_slew(problem)
    R, v, _ = slew.evaluate(np.array([0.0, 0.5, 1.0]) * problem.duration)
    total = so3.distance(problem.start.orientation, problem.goal.orientation)
    np.testing.assert_allclose(R[0], problem.start.orientation, atol=1e-14)
    np.testing.assert_allclose(R[2], problem.goal.orientation, atol=1e-14)
    np.testing.assert_allclose(so3.distance(R[0], R[1]), 0.5 * total, rtol=1e-12)
    np.testing.assert_allclose(v[[0, 2]], 0.0, atol=1e-14)


def test_straight_slew_on_s2_takes_the_shortest_way():
    problem = parse_problem(json.loads(LINES[2]))
    path = straight_slew(problem).evaluate(np.linspace(0.0, problem.duration, 9))[0]
    directions = path @ problem.boresight
    ends = directions[0], directions[-1]
    np.testing.assert_allclose(ends[0], problem.start.orientation @ problem.boresight, atol=1e-14)
    np.testing.assert_allclose(ends[1], problem.goal.orientation @ problem.boresight, atol=1e-14)
    normal = np.cross(*ends)
    np.testing.assert_allclose(directions @ normal, 0.0, atol=1e-14)
