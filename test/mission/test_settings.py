# SPDX-License-Identifier: Apache-2.0
"""Parameters: what is declared, what the file lists, what is refused."""

import re
from pathlib import Path

import pytest
import yaml
from simulation import settings

from riem_planner.errors import InvalidProblemError
from riem_planner.mission.reference import parameters_page, planner_yaml
from riem_planner.mission.settings import (
    SPECIFICATIONS,
    ZONE_SPECIFICATIONS,
    default_values,
    settings_from_values,
)

ROOT = Path(__file__).resolve().parents[2]
PLANNER = ROOT / "config" / "planner.yaml"
DEMO = PLANNER.with_name("demo.yaml")


def test_the_file_and_the_page_are_those_of_the_table():
    assert PLANNER.read_text() == planner_yaml()
    assert (ROOT / "docs" / "parameters.md").read_text() == parameters_page()


def test_the_file_sets_every_parameter_to_its_default():
    listed = yaml.safe_load(PLANNER.read_text())["/**"]["ros__parameters"]
    assert listed == {s.name: s.default if s.default is not None else [] for s in SPECIFICATIONS}
    rows = re.findall(r"^ *# ((?:zones|bodies)\.sun\.[a-z_]+: .*)$", PLANNER.read_text(), re.M)
    zone, body = default_values(("sun",)), default_values((), ("sun",))
    keys = default_values()
    assert yaml.safe_load("\n".join(rows)) == {
        name: value for name, value in {**zone, **body}.items() if name not in keys
    }


def test_every_description_ends_with_the_unit_of_its_number():
    for item in (*SPECIFICATIONS, *ZONE_SPECIFICATIONS):
        if item.kind in ("number", "integer", "numbers", "scalar_or_numbers"):
            assert re.search(r"\[[^\[\]]+\]$", item.description), item.name


def test_the_demonstration_is_the_published_manoeuvre():
    from riem_planner import certify
    from riem_planner.demo.demo import problem_of, settings_of
    from riem_planner.plots.straight import straight_slew

    problem = problem_of(settings_of(DEMO))
    published = yaml.safe_load((PLANNER.parent / "problems" / "bevo2_case2.yaml").read_text())
    for state, key in ((problem.start, "start"), (problem.goal, "goal")):
        cosine = state.quaternion_xyzw @ published[key]["orientation"]  # q and -q are the same
        assert abs(cosine) == pytest.approx(1.0)
    assert not certify(straight_slew(problem), problem).certified


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("duration", -1.0, "duration"),
        ("duration", float("nan"), "duration"),
        ("duration", 0.0, "limits"),
        ("space", "r3", "so3 or s2"),
        ("boresight", [0.0, 0.0, 0.0], "boresight"),
        ("boresight", [1.0, 0.0], "3 numbers"),
        ("start.orientation", [1.0, 1.0, 0.0, 0.0], "unit quaternion"),
        ("goal.orientation", [0.0, 0.0, 0.0], "4 numbers"),
        ("limits.torque", 1.0, "inertia"),
        ("limits.rate", [0.1, 0.1], "1 or 3"),
        ("inertia", [1.0] * 8, "9 numbers"),
        ("zones.sun.half_angle", -0.1, "zones.sun.half_angle"),
        ("zones.sun.kind", "keep_off", "keep_out or keep_in"),
        ("zones.sun.group", "sensors", "keep_in"),
        ("zones.sun.direction", [0.0, 0.0, 0.0], "zones.sun.direction"),
        ("zone_names", ["sun", "sun"], "twice"),
        ("reference_frame", "", "frame"),
    ],
)
def test_wrong_values_are_refused_by_name(name, value, told):
    values = {**default_values(("sun",)), name: value}
    with pytest.raises(InvalidProblemError, match=re.escape(told)):
        settings_from_values(values)


def test_unset_is_none_and_a_scalar_limit_is_of_the_norm():
    given = settings(limits_DOT_rate=0.1)
    assert given.goal_orientation is None
    assert given.limits.rate == 0.1
    assert settings().limits is None


def test_the_rviz_configuration_shows_the_topics_of_the_node():
    shown = yaml.safe_load(PLANNER.with_name("planner.rviz").read_text())
    displays = shown["Visualization Manager"]["Displays"]
    topics = {d["Topic"]["Value"]: d["Topic"] for d in displays if "Topic" in d}
    assert {"/riem_planner/markers", "/riem_planner/trajectory"} <= topics.keys()
    assert topics["/riem_planner/markers"]["Durability Policy"] == "Transient Local"
    frame = shown["Visualization Manager"]["Global Options"]["Fixed Frame"]
    assert frame == settings().reference_frame


def test_least_time_and_wheels_are_settings():
    wheels = [1.0, 0.0, 0.0, 0.005, 0.12, 0.0, 2.0, 0.0, 0.005, 0.12, 0.0, 0.0, 1.0, 0.01, 0.12]
    values = default_values() | {
        "objective": "least_time", "duration": 0.0, "limits.wheels": wheels, "limits.jerk": [5e-4],
        "inertia": [2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 4.0],
    }  # fmt: skip
    settings = settings_from_values(values)
    assert settings.objective == "least_time"
    assert settings.limits.keys == ("jerk", "wheels")
    assert [wheel.torque for wheel in settings.limits.wheels] == [0.005, 0.005, 0.01]
    for key, value, name in (
        ("duration", 60.0, "duration"), ("limits.wheels", wheels[:14], "limits.wheels"),
    ):  # fmt: skip
        with pytest.raises(InvalidProblemError) as refusal:
            settings_from_values(values | {key: value})
        assert refusal.value.key == name
