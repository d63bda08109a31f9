# SPDX-License-Identifier: Apache-2.0
"""Documents that name bodies, orbits and a spacecraft, where they need no ephemeris."""

import pytest

from riem_planner.errors import InvalidProblemError
from riem_planner.files.problem_files import parse_problem, read_problem
from riem_planner.files.resolving import resolved

EPOCH = "2027-03-01T06:00:00Z"
ORBIT = {
    "circular": {
        "altitude_km": 600, "inclination_deg": 28.5, "raan_deg": 40, "argument_of_latitude_deg": 184
    }
}  # fmt: skip
LINE_1 = "1 25544U 98067A   24001.50000000  .00016717  00000-0  10270-3 0  9009"
LINE_2 = "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.49815350000011"
SUN = {"kind": "keep_out", "body": "sun", "half_angle_deg": 30, "normalized_strength": 0.01}


def document(**more):
    attitude = {"orientation": [0, 0, 0, 1]}
    return {"space": "so3", "duration": 40, "start": attitude, "goal": attitude} | more


def test_document_without_sky_is_left_as_it_is():
    stated = document(obstacles=[{"kind": "keep_out", "direction": [0, 1, 0], "strength": 1}])
    assert resolved(stated) is stated


def test_body_that_is_a_direction_needs_no_ephemeris():
    bodies = {"lamp": {"direction": [0, 1, 0], "rate": [0, 0, 0.001]}}
    zone = {"kind": "keep_out", "body": "lamp", "half_angle_deg": 5, "normalized_strength": 0.01}
    goal = {"boresight": [0, 0, 1], "body": "lamp"}
    result = resolved(document(bodies=bodies, obstacles=[zone], goal=goal))
    assert result["goal"] == {"boresight": [0, 0, 1], **bodies["lamp"]}
    assert result["obstacles"][0]["rate"] == [0, 0, 0.001]
    assert "bodies" not in result
    assert parse_problem(document(bodies=bodies, goal=goal)).goal.moves


SPACECRAFT = """
inertia: [2, 0, 0, 0, 2, 0, 0, 0, 3]
limits: {torque: 0.1}
instruments:
  tracker_1:
    boresight: [1, 0, 0]
    zones:
      - &sun {kind: keep_out, body: lamp, half_angle_deg: 30, normalized_strength: 0.01}
      - {<<: *sun, name: shade, half_angle_deg: 35}
  tracker_2: {boresight: [0, 1, 0], zones: [*sun]}
  telescope: {boresight: [0, 0, 2]}
any_of: {trackers: [tracker_1, tracker_2]}
"""


def test_spacecraft_file_beside_the_problem_gives_zones_groups_limits_and_axes(tmp_path):
    (tmp_path / "craft.yaml").write_text(SPACECRAFT, encoding="utf-8")
    stated = document(
        bodies={"lamp": {"direction": [0, 1, 0]}},
        spacecraft="craft.yaml",
        goal={"boresight": "telescope", "body": "lamp"},
        obstacles=[SUN | {"body": "lamp", "boresight": "telescope"}],
    )
    result = resolved(stated, tmp_path)
    assert result["limits"] == {"torque": 0.1}
    assert len(result["inertia"]) == 9
    assert result["goal"]["boresight"] == [0, 0, 2]
    first, second, third, own = result["obstacles"]
    assert (first["name"], second["name"]) == ("tracker_1.lamp", "tracker_1.shade")
    assert (first["group"], first["member"]) == ("trackers", "tracker_1")
    assert (third["name"], third["member"]) == ("tracker_2.lamp", "tracker_2")
    assert second["half_angle_deg"] == 35
    assert own["boresight"] == [0, 0, 2]
    assert "spacecraft" not in result


def test_problem_file_finds_its_spacecraft_beside_it(tmp_path):
    (tmp_path / "craft.yaml").write_text("limits: {rate: 0.5}\n", encoding="utf-8")
    (tmp_path / "problem.yaml").write_text(
        "{space: so3, duration: 40, spacecraft: craft.yaml, start: {orientation: [0, 0, 0, 1]},"
        " goal: {orientation: [0, 0, 0, 1]}}",
        encoding="utf-8",
    )
    assert read_problem(tmp_path / "problem.yaml").limits.rate == 0.5


WRONG = {
    "unknown body": (
        {"obstacles": [SUN | {"body": "snu"}], "epoch": EPOCH, "orbit": ORBIT},
        "obstacles[0].body", "unknown body 'snu'; did you mean sun?",
    ),
    "body that is no name": ({"obstacles": [SUN | {"body": 3}]}, "obstacles[0].body", "name"),
    "no epoch": (
        {"obstacles": [SUN], "orbit": ORBIT}, "epoch",
        "missing; body sun needs it (2027-03-01T06:00:00Z)",
    ),
    "no orbit": ({"obstacles": [SUN], "epoch": EPOCH}, "orbit", "missing; "),
    "frame without an orbit": (
        {"goal": {"frame": "lvlh", "orientation": [0, 0, 0, 1]}, "epoch": EPOCH}, "orbit",
        "missing; frame lvlh",
    ),
    "unknown frame": (
        {"goal": {"frame": "lvhl", "orientation": [0, 0, 0, 1]}, "epoch": EPOCH, "orbit": ORBIT},
        "goal.frame", "lvlh",
    ),
    "two places": (
        {"obstacles": [SUN | {"direction": [1, 0, 0]}], "epoch": EPOCH, "orbit": ORBIT},
        "obstacles[0]", "direction and body",
    ),
    "limb of nothing": (
        {"obstacles": [{"limb_angle_deg": 3}]}, "obstacles[0].limb_angle_deg", "sun, moon or earth",
    ),
    "limb and angle": (
        {"obstacles": [SUN | {"limb_angle_deg": 3}]}, "obstacles[0].limb_angle_deg",
        "half_angle_deg",
    ),
    "two orbits": (
        {"orbit": ORBIT | {"tle": [LINE_1, LINE_2]}}, "orbit", "one of tle, state, circular",
    ),
    "below the ground": (
        {"orbit": {"circular": ORBIT["circular"] | {"altitude_km": -1}}},
        "orbit.circular.altitude_km", "above 0 km, got -1",
    ),
    "missing angle": (
        {"orbit": {"circular": {"altitude_km": 600}}}, "orbit.circular.inclination_deg", "missing",
    ),
    "inside the Earth": (
        {"orbit": {"state": {"position_km": [6000, 0, 0], "velocity_km_s": [0, 7, 0]}}},
        "orbit.state.position_km", "6378.14 km",
    ),
    "escape": (
        {"orbit": {"state": {"position_km": [7000, 0, 0], "velocity_km_s": [0, 11, 0]}}},
        "orbit.state.velocity_km_s", "escape",
    ),
    "checksum of line 1": (
        {"orbit": {"tle": [LINE_1[:-1] + "8", LINE_2]}}, "orbit.tle[0]",
        "ends in 8, its digits make 9",
    ),
    "checksum of line 2": (
        {"orbit": {"tle": [LINE_1, LINE_2[:-1] + "6"]}}, "orbit.tle[1]", "checksum",
    ),
    "lines of two satellites": (
        {"orbit": {"tle": [LINE_1, LINE_2.replace("25544", "25545")[:-1] + "2"]}}, "orbit.tle",
        "25544 and 25545",
    ),
    "lines swapped": ({"orbit": {"tle": [LINE_2, LINE_1]}}, "orbit.tle[0]", "begins with 1"),
    "a line cut off": ({"orbit": {"tle": [LINE_1[:60], LINE_2]}}, "orbit.tle[0]", "69"),
    "one line": ({"orbit": {"tle": [LINE_1]}}, "orbit.tle", "two lines"),
    "star beyond the pole": (
        {"bodies": {"x": {"ra_deg": 10, "dec_deg": 91}}}, "bodies.x.dec_deg", "91",
    ),
    "star and site": (
        {"bodies": {"x": {"ra_deg": 10, "latitude_deg": 1}}}, "bodies.x", "star and site",
    ),
    "body of nothing": ({"bodies": {"x": {}}}, "bodies.x", "got none"),
    "no spacecraft": ({"spacecraft": "nowhere.yaml"}, "spacecraft", "nowhere.yaml can't be read"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_value_is_named_with_its_key_and_a_remedy(case, tmp_path):
    more, key, words = WRONG[case]
    with pytest.raises(InvalidProblemError) as caught:
        resolved(document(**more), tmp_path)
    assert caught.value.key == key
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("any_of: {a: [x]}", "any_of.a", "unknown instrument 'x'"),
        ("instruments: {x: {zones: []}}", "instruments.x.boresight", "missing"),
        ("instruments: {x: {boresight: [1, 0, 0], zone: []}}", "instruments.x.zone", "zones?"),
        ("inertias: [1]", "inertias", "did you mean inertia?"),
    ],
)
def test_what_is_wrong_in_a_spacecraft_file_names_the_file(text, key, words, tmp_path):
    (tmp_path / "craft.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidProblemError) as caught:
        resolved(document(spacecraft="craft.yaml"), tmp_path)
    assert "craft.yaml" in caught.value.key
    assert caught.value.key.endswith(key)
    assert words in str(caught.value)
