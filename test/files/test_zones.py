# SPDX-License-Identifier: Apache-2.0
"""Zones that move and change, in problem files: read, written, judged; errors by their key."""

import json

import numpy as np
import pytest

from riem_planner.errors import InvalidProblemError
from riem_planner.files.problem_files import parse_problem
from riem_planner.files.problem_writing import problem_document
from riem_planner.riem_plan import command

TIMES = [0.0, 20.0, 40.0, 60.0]
DIRECTIONS = [[0.2, 0.9, 0.3], [0.3, 0.9, 0.3], [0.4, 0.9, 0.4], [0.5, 0.9, 0.5]]
MOON = {
    "name": "moon", "kind": "keep_out", "times": TIMES, "directions": DIRECTIONS,
    "half_angles_deg": [10.0, 11.0, 12.0, 13.0], "active": [[0, 20], [30, 60]],
}  # fmt: skip
EARTH = {
    "name": "earth", "kind": "keep_out", "direction": [0.2, 0.9, 0.1], "rate": [0, 0, 1e-3],
    "half_angle_deg": 9.0, "boresight": [0, 0, 1], "group": "trackers", "member": "one",
    "normalized_strength": 0.02,
}  # fmt: skip
SUN = {**EARTH, "name": "sun", "direction": [0.2, -0.9, 0.1], "member": "two"}


def document_of(*obstacles, **more):
    return {
        "space": "so3",
        "duration": 60.0,
        "start": {"orientation": [0, 0, 0, 1]},
        "goal": {"orientation": [0, 0, 0.6, 0.8]},
        "obstacles": list(obstacles),
        **more,
    }


def test_zones_that_change_are_read_and_written_back():
    problem = parse_problem(document_of(MOON, EARTH, SUN))
    moon, earth, sun = problem.obstacles
    assert moon.path is not None
    assert moon.active == ((0.0, 20.0), (30.0, 60.0))
    assert moon.normalized_strength == 0.01
    assert (earth.group, earth.member, sun.member) == ("trackers", "one", "two")
    assert problem.forbidden.names == ("moon", "trackers")
    again = parse_problem(json.loads(json.dumps(problem_document(problem))))
    attitudes = np.array([problem.start.orientation, problem.arrival.orientation])
    for t in (5.0, 25.0, 50.0):
        first, second = (p.forbidden.margins(attitudes, t) for p in (problem, again))
        for name, margins in first.items():
            np.testing.assert_allclose(second[name], margins, atol=1e-14)
    np.testing.assert_allclose(
        again.forbidden.normalised_table(60.0), problem.forbidden.normalised_table(60.0), atol=1e-13
    )


def test_one_window_needs_no_list_of_windows():
    problem = parse_problem(document_of({**MOON, "active": [10, 20]}))
    assert problem.obstacles[0].active == ((10.0, 20.0),)


def test_a_plan_past_changing_zones_is_judged_from_its_files(tmp_path, capsys):
    problem, plan = tmp_path / "problem.json", tmp_path / "plan.json"
    problem.write_text(json.dumps(document_of(MOON, EARTH, SUN)), encoding="utf-8")
    assert command.main([str(problem), "--output", str(plan)]) == command.SOLVED
    written = json.loads(plan.read_text(encoding="utf-8"))
    assert set(written["clearance_deg"]) == {"moon", "trackers"}
    assert command.main([str(problem), "--certificate-only", str(plan)]) == command.SOLVED
    assert command.main(["--certificate-only", str(plan)]) == command.SOLVED
    over = {**MOON, "directions": [[0.8, 0.6, 0.0]] * 4}
    problem.write_text(json.dumps(document_of(over)), encoding="utf-8")
    assert command.main([str(problem), "--certificate-only", str(plan)]) == command.NO_TRAJECTORY
    assert "moon: enters the zone" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"active": [20, 10]}, "obstacles[0].active: expected [start, end] with start < end"),
        ({"active": [[0, 1], [5]]}, "obstacles[0].active: expected [start, end] with start < end"),
        ({"active": 3}, "obstacles[0].active: expected [start, end] with start < end, or a list"),
        (
            {"times": [0, 10, 20, 30]},
            "obstacles[0].times: end at 30 s, before the arrival",
        ),
        ({"times": [0, 10, 20]}, "obstacles[0].times: expected a list of 4 times"),
        ({"times": [0, 20, 20, 60]}, "obstacles[0].times[2]: expected increasing times"),
        (
            {"directions": DIRECTIONS[:3], "times": TIMES[:3]},
            "obstacles[0].times: expected",
        ),
        ({"half_angles_deg": [10.0]}, "obstacles[0].half_angles_deg: expected a list of 4 angles"),
        ({"half_angles_deg": [1, 2, 3, 180]}, "obstacles[0].half_angles_deg[3]: expected an angle"),
        ({"half_angle_deg": 3}, "obstacles[0].half_angles_deg: given beside half_angle_deg"),
        ({"direction": [1, 0, 0]}, "obstacles[0].direction: expected exactly one of direction"),
        ({"rate": [0, 0, 1]}, "obstacles[0].rate: belongs to a direction"),
        ({"member": "one"}, "obstacles[0].member: expected a group beside it"),
        ({"member": 3, "group": "g"}, "obstacles[0].member: expected text"),
    ],
)
def test_wrong_zones_are_named_by_their_key(change, said):
    with pytest.raises(InvalidProblemError) as caught:
        parse_problem(document_of({**MOON, **change}))
    assert str(caught.value).startswith(said)


def test_a_hold_has_to_be_covered_too():
    with pytest.raises(InvalidProblemError) as caught:
        parse_problem(document_of(MOON, hold=20.0))
    expected = "obstacles[0].times: end at 60 s, before the arrival and hold at 80 s"
    assert str(caught.value) == expected
