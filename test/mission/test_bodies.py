# SPDX-License-Identifier: Apache-2.0
"""One body that several zones follow, and orientation obstacles that turn."""

import numpy as np
import pytest
from simulation import SECOND, START_NS, Simulation, discontinuities, settings

from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.mission.codes import Code
from riem_planner.mission.settings import default_values, settings_from_values
from riem_planner.mission.zone_tracker import TurningBodies, World

Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.5]))
ZONES = ("tracker", "side")


def _values(**more):
    values = default_values(ZONES, ("sun",)) | {
        "duration": 10.0,
        "zones.tracker.body": "sun",
        "zones.tracker.half_angle": 0.3,
        "zones.side.body": "sun",
        "zones.side.half_angle": 0.2,
        "zones.side.boresight": [0.8, 0.6, 0.0],
    }
    return values | {name.replace("__", "."): value for name, value in more.items()}


def _simulation(**more):
    return Simulation(settings_from_values(_values(**more)))


def _tell(simulation, direction):
    d = np.array(direction)
    now_ns = simulation.now_ns
    simulation.mission.see_direction("bodies/sun", d / np.linalg.norm(d), now_ns, now_ns)


def test_one_message_moves_every_zone_of_the_body():
    simulation = _simulation()
    assert simulation.mission.world.missing == ("tracker (body sun)", "side (body sun)")
    simulation.goal(Z_TURN)
    simulation.run(0.5)
    assert not simulation.setpoints
    _tell(simulation, [0.0, 0.0, 1.0])
    simulation.run(0.5)
    assert simulation.setpoints
    for zone in simulation.mission.world.obstacles(simulation.now_ns):
        assert zone.direction == pytest.approx([0.0, 0.0, 1.0])


def test_it_is_judged_once_so_that_at_most_one_rescue_and_one_plan_come_of_it(monkeypatch):
    simulation = _simulation()
    _tell(simulation, [0.0, 0.0, 1.0])
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    checks = []
    check = simulation.mission.flight.check

    def counted(now_ns):
        checks.append(now_ns)
        return check(now_ns)

    monkeypatch.setattr(simulation.mission.flight, "check", counted)
    _tell(simulation, so3.exp(np.array([0.0, 0.0, 1.2])) @ np.array([1.0, 0.0, 0.05]))
    assert len(checks) == 1
    simulation.run(0.5)
    codes = simulation.codes()
    assert codes.count("STOP") + codes.count("DODGE") == 1
    assert codes.count("FLYING") == 2
    simulation.run(12.0)
    assert not discontinuities(simulation.setpoints)


def test_a_parameter_of_the_body_moves_them_too():
    given = settings_from_values(_values(bodies__sun__direction=[0.0, 1.0, 0.0]))
    assert {zone.source for zone in given.zones} == {"bodies/sun"}
    assert all(zone.direction.tolist() == [0.0, 1.0, 0.0] for zone in given.zones)
    assert given.bodies == ("sun",)


@pytest.mark.parametrize(
    ("key", "value"),
    [("direction", [1.0, 0.0, 0.0]), ("rate", [0.0, 0.0, 0.1]), ("timeout", 1.0)],
)
def test_a_zone_of_a_body_has_no_place_of_its_own(key, value):
    with pytest.raises(InvalidProblemError, match=f"zones.side.{key}.*bodies.sun.{key}"):
        settings_from_values(_values(**{f"zones__side__{key}": value}))


def _turning(rate=(0.0, 0.0, 0.02), stamp_ns=START_NS, turn=(0.0, 0.0, 0.9)):
    quaternions = np.array([so3.quaternion_exp(np.array(turn))])
    return TurningBodies(("other",), quaternions, np.array([rate]), stamp_ns)


def test_an_obstacle_that_turns_is_where_its_rate_takes_it():
    world = World(settings(obstacle_radius=0.1))
    world.update_turning(_turning(rate=(0.1, 0.0, 0.0), turn=(0.0, 0.5, 0.0)))
    (obstacle,) = world.obstacles(START_NS + 3 * SECOND)
    told = so3.exp(np.array([0.0, 0.5, 0.0]))
    for after in (0.0, 2.0):
        expected = told @ so3.exp(np.array([0.1 * (3.0 + after), 0.0, 0.0]))
        assert obstacle.distance(expected, np.asarray(after)) == pytest.approx(0.0, abs=1e-7)
    assert world.moving


def test_one_that_will_cross_the_way_is_gone_round_before_it_does():
    simulation = Simulation(settings(duration=10.0, obstacle_radius=0.2))
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    # Clear of the way by now; in four seconds it is upon it.
    rate = np.array([-0.15, 0.0, 0.0])
    q = so3.quaternion_multiply(
        so3.quaternion_exp(np.array([0.0, 0.0, 0.75])), so3.quaternion_exp(-4.0 * rate)
    )
    told_ns = simulation.now_ns
    bodies = TurningBodies(("other",), np.array([q]), np.array([rate]), told_ns)
    simulation.mission.see_turning(bodies, told_ns)
    simulation.run(14.0)
    assert "FLYING" in simulation.codes()[1:]
    for setpoint in simulation.setpoints:
        elapsed = (setpoint.stamp_ns - told_ns) * 1e-9
        there = so3.quaternion_multiply(q, so3.quaternion_exp(rate * elapsed))
        if elapsed >= simulation.mission.settings.planning_budget:
            assert so3.quaternion_distance(there, setpoint.quaternion) > 0.2 - 1e-7
    assert not discontinuities(simulation.setpoints)
    simulation.mission.see_turning(TurningBodies((), np.zeros((0, 4)), np.zeros((0, 3)), 0), 1)
    assert not simulation.mission.world.obstacles(simulation.now_ns)


def test_obstacles_grow_once_their_data_is_too_old():
    world = World(settings(obstacle_radius=0.1, obstacle_timeout=2.0, obstacle_max_speed=0.05))
    world.update_turning(_turning())
    world.update_orientations(np.array([Z_TURN]), START_NS)
    assert {o.radius for o in world.obstacles(START_NS + 2 * SECOND)} == {0.1}
    later = START_NS + 4 * SECOND
    assert all(o.radius >= 0.2 for o in world.obstacles(later))
    assert world.stale(later) == ("obstacles", "obstacle_states")


def test_a_zone_told_late_is_taken_as_of_its_stamp():
    parameters = settings(("sun",), sun__rate=[0.0, 0.0, 0.1], sun__timeout=5.0, sun__max_speed=0.1)
    simulation = Simulation(parameters)
    old_ns = simulation.now_ns - 10 * SECOND
    simulation.mission.see_direction("zones/sun", np.eye(3)[0], old_ns, simulation.now_ns)
    (zone,) = simulation.mission.world.obstacles(simulation.now_ns)
    assert zone.direction == pytest.approx([np.cos(1.0), np.sin(1.0), 0.0])
    assert zone.half_angle > parameters.zones[0].half_angle + 0.5
    assert Code.WAITING.name not in simulation.codes()
