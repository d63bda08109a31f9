# SPDX-License-Identifier: Apache-2.0
"""The plan page: one file, whole, small, and true to the plan that it shows."""

import json
import math
import re

import numpy as np
import pytest

from riem_planner import (
    S2,
    SO3,
    Limits,
    OrientationObstacle,
    Problem,
    State,
    Zone,
    __version__,
    solve,
)
from riem_planner.page import plan_page
from riem_planner.page.document import MOST_BYTES
from riem_planner.riem_plan.command import main
from riem_planner.riem_plan.planning import plan_problem

HOSTILE = '</script><script>alert("x")</script>{{data}}\u2028'


def problem(**changes):
    stated = {
        "start": State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0]),
        "goal": State.from_quaternion_xyzw([0.0, 0.0, 0.8, 0.6]),
        "duration": 60.0,
        "space": SO3,
        "obstacles": (
            Zone([0.7, 0.7, 0.1], 0.3, normalized_strength=0.01, name="sun", rate=[0, 0, 1e-3]),
            OrientationObstacle(np.diag([1.0, -1.0, -1.0]), normalized_strength=0.01, name="q1"),
        ),
        "limits": Limits(rate=0.2, torque=[0.1, 0.1, 0.1], inertia=np.diag([2.0, 2.0, 3.0])),
        "name": "slew",
    }
    return Problem(**{**stated, **changes})


def page_of(stated, samples=101):
    plan = plan_problem(stated, samples)
    text = plan_page(stated, plan.solution, plan.trajectory, plan.certificate, version=__version__)
    return text, plan


def data_of(text):
    return json.loads(
        re.search(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.S)[1]
    )


def test_the_page_holds_the_plan_and_its_certificate():
    text, plan = page_of(problem())
    data = data_of(text)
    shown = data["plans"][0]
    np.testing.assert_array_equal(shown["orientations"], plan.trajectory.quaternions_xyzw)
    np.testing.assert_array_equal(shown["rates"], plan.trajectory.angular_velocities)
    np.testing.assert_array_equal(shown["accelerations"], plan.trajectory.angular_accelerations)
    J = np.diag([2.0, 2.0, 3.0])
    v, a = plan.trajectory.angular_velocities, plan.trajectory.angular_accelerations
    np.testing.assert_allclose(shown["torque"], a @ J + np.cross(v, v @ J), rtol=1e-5, atol=1e-12)
    least = {name: math.degrees(x) for name, x in plan.certificate.clearance.items()}
    assert data["certificate"]["clearance_deg"] == pytest.approx(least)
    assert data["limits"] == {"rate": 0.2, "torque": [0.1, 0.1, 0.1]}


def test_a_moving_zone_is_told_where_it_is():
    stated = problem()
    zone = stated.obstacles[0]
    shown = data_of(page_of(stated)[0])["sets"][0]
    assert len(shown["directions"]) == len(shown["times"]) > 100
    at = zone.direction_at(np.array(shown["times"]))
    np.testing.assert_allclose(shown["directions"], at, atol=1e-6)


def test_names_enter_as_text_only_and_nothing_outside_is_named():
    sun = Zone([0.7, 0.7, 0.1], 0.3, normalized_strength=0.01, name=HOSTILE)
    text, _ = page_of(problem(obstacles=(sun,), name=HOSTILE))
    assert "<script>alert" not in text
    assert data_of(text)["name"] == HOSTILE
    assert data_of(text)["sets"][0]["name"] == HOSTILE
    assert not re.search(
        r"(src|href)\s*=|url\(|import\s*\(|fetch\(|https?://(?!www\.w3\.org)", text
    )
    assert "default-src 'none'" in text


def test_a_long_plan_is_thinned_to_a_megabyte_and_the_page_says_so():
    text, plan = page_of(problem(), samples=6001)
    data = data_of(text)
    assert len(text.encode()) <= MOST_BYTES == 10**6
    assert data["samples"] == 6001 > data["shown"] == len(data["plans"][0]["times"])
    assert data["certificate"]["clearance_deg"] == pytest.approx(
        {name: math.degrees(x) for name, x in plan.certificate.clearance.items()}
    )


@pytest.mark.parametrize("space", [SO3, S2])
def test_a_refused_problem_has_a_page_with_its_zones_ends_and_message(space):
    stated = problem(
        space=space,
        goal=State.from_direction([0.0, 1.0, 0.0]),
        start=State.from_direction([1.0, 0.0, 0.0]),
        obstacles=(Zone([0.0, 1.0, 0.0], 0.3, normalized_strength=0.01, name="sun"),),
        limits=None,
    )
    solution = solve(stated)
    data = data_of(plan_page(stated, solution))
    assert data["plans"] == []
    assert data["status"] == "GOAL_IN_ZONE"
    assert data["message"] == solution.message
    assert data["sets"][0]["half_angles"] == [0.3]
    np.testing.assert_allclose(data["goal"], stated.goal.quaternion_xyzw)


def test_the_command_writes_the_page_beside_plan_and_figure(tmp_path):
    file = tmp_path / "problem.json"
    file.write_text(json.dumps(DOCUMENT))
    page, plan = tmp_path / "page.html", tmp_path / "plan.json"
    assert main([str(file), "--html", str(page), "--output", str(plan)]) == 0
    data = data_of(page.read_text(encoding="utf-8"))
    assert data["plans"][0]["times"] == json.loads(plan.read_text())["times"]
    assert data["version"] == __version__


def test_the_command_refuses_a_page_of_many(tmp_path, capsys):
    file = tmp_path / "problems.jsonl"
    file.write_text(json.dumps(DOCUMENT) + "\n")
    with pytest.raises(SystemExit, match="2"):
        main([str(file), "--html", str(tmp_path / "page.html")])
    assert "--html shows one plan: give it a single problem" in capsys.readouterr().err


DOCUMENT = {
    "space": "so3",
    "duration": 30.0,
    "start": {"orientation": [0, 0, 0, 1]},
    "goal": {"orientation": [0, 0, 0.6, 0.8]},
}
