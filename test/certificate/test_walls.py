# SPDX-License-Identifier: Apache-2.0
"""A wall of zones proves that there is no path; an open cover has none."""

import json

import numpy as np
import pytest

from riem_planner import S2, SO3, Problem, State, Status, Zone, solve
from riem_planner.certificate.walls import find_wall
from riem_planner.files.plan_files import encoded, plan_document
from riem_planner.files.problem_writing import problem_document
from riem_planner.proof import check
from riem_planner.riem_plan.planning import plan_problem

EMPTY = {key: [] for key in check.SAMPLES.split()}


def ring(count, radius, angle=0.8, about=(0.0, 0.0, 1.0), kind="keep_out"):
    """Zones on a circle about an axis."""
    about = np.array(about)
    e = np.cross(about, [0.3, 0.5, 0.2])
    e /= np.linalg.norm(e)
    turns = 2 * np.pi * np.arange(count) / count
    sides = np.cos(turns)[:, None] * e + np.sin(turns)[:, None] * np.cross(about, e)
    return [
        Zone(np.cos(angle) * about + np.sin(angle) * side, radius, name=f"z{i}", kind=kind,
             normalized_strength=0.01)
        for i, side in enumerate(sides)
    ]  # fmt: skip


def problem(zones, space=S2, goal=(0.1, 0.2, -1.0)):
    start, goal = (State.from_direction(x) for x in ((0.0, 0.1, 1.0), goal))
    return Problem(start, goal, 10.0, space, obstacles=tuple(zones))


# Neighbours of twelve zones on a circle of 0.8 rad are 0.3735 rad apart.
APART = 2 * np.arcsin(np.sin(0.8) * np.sin(np.pi / 12))


@pytest.mark.parametrize("space", [S2, SO3])
@pytest.mark.requirement("RP-023")
def test_a_closed_ring_is_a_wall_that_the_checker_proves(space):
    sealed = problem(ring(12, 0.5 * APART + 1e-6), space)
    solution = solve(sealed)
    assert solution.status is Status.NO_CERTIFIED_TRAJECTORY
    assert "sealed" in solution.message
    assert len(solution.wall) == 12
    document = plan_document(plan_problem(sealed))
    assert document["wall"] == list(solution.wall)
    said = check.examine(json.dumps(problem_document(sealed)), encoded(document))
    assert "12 zones" in said


@pytest.mark.parametrize("zones", [
    ring(12, 0.5 * APART - 1e-9),
    ring(12, 0.5 * APART + 0.1)[:11],
    ring(12, 0.5 * APART + 0.1, about=(1.0, 0.0, 0.0)),
    [],
])  # fmt: skip
def test_what_is_open_has_no_wall(zones):
    assert find_wall(problem(zones)) == ()


def test_goals_on_one_side_of_a_ring_are_not_parted():
    assert find_wall(problem(ring(12, 0.3), goal=(0.1, 0.0, 1.0))) == ()


def test_a_keep_in_zone_is_the_wall_of_its_complement():
    """Two keep-outs and the outside of a keep-in zone close a chain round the start."""
    zones = [*ring(12, 0.5 * APART + 0.02)]
    outside = Zone(-zones[0].direction, np.pi - zones[0].half_angle, name="in", kind="keep_in",
                   normalized_strength=0.01)  # fmt: skip
    wall = find_wall(problem([outside, *zones[1:]]))
    assert "in" in wall


@pytest.mark.parametrize("change", ["gap", "dropped", "misnamed", "moving", "grouped"])
@pytest.mark.requirement("RP-023")
def test_false_walls_are_not_accepted(change):
    zones = ring(12, 0.5 * APART + 1e-6)
    wall = list(find_wall(problem(zones)))
    document = problem_document(problem(zones))
    first = next(z for z in document["obstacles"] if z["name"] == wall[0])
    if change == "gap":
        first["half_angle_deg"] = float(np.degrees(0.5 * APART - 1e-6 - 1e-9))
    elif change == "dropped":
        wall.pop()
    elif change == "misnamed":
        wall[0] = "z99"
    elif change == "moving":
        first["rate"] = [0.0, 0.0, 1e-9]
    else:
        first |= {"group": "g", "kind": "keep_out"}
    plan = EMPTY
    with pytest.raises(check.Verdict):
        check.examine(json.dumps(document), json.dumps(plan | {"wall": wall}))


def test_a_wall_does_not_part_a_goal_that_is_on_the_side_of_the_start():
    zones = ring(12, 0.5 * APART + 1e-6)
    wall = list(find_wall(problem(zones)))
    plan = EMPTY | {"wall": wall}
    near = problem_document(problem(zones, goal=(0.1, 0.0, 1.0)))
    with pytest.raises(check.Verdict, match="part"):
        check.examine(json.dumps(near), json.dumps(plan))


@pytest.mark.requirement("RP-023")
def test_only_a_wall_is_called_sealed():
    closed_by_two_boresights = [
        Zone((0.0, 0.0, -1.0), 1.2, name="a", normalized_strength=0.01),
        *ring(5, 0.3, angle=1.2),
    ]
    solution = solve(problem(closed_by_two_boresights, goal=(0.4, 0.0, 1.0)))
    assert "seal" not in solution.message.lower()
    assert "seal" not in Status.NO_CERTIFIED_TRAJECTORY.advice
