# SPDX-License-Identifier: Apache-2.0
"""What becomes of goals: each has exactly one end, and what is told of it is so."""

import numpy as np
import pytest
from simulation import SECOND, START_NS, Simulation, settings

from riem_planner.geometry import so3
from riem_planner.mission.codes import Code, code_of
from riem_planner.mission.mission import Mission
from riem_planner.mission.planning import Goal
from riem_planner.solution import Status

Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.5]))
X_TURN = so3.quaternion_exp(np.array([1.0, 0.2, 0.0]))
AT_THE_SUN = so3.quaternion_exp(np.array([0.0, -1.5, 0.0]))
REST = np.zeros(3)


def _simulation(zones=("sun",), **values):
    sun = {"sun__direction": [0.0, 0.0, 1.0], "sun__half_angle": 0.3} if "sun" in zones else {}
    return Simulation(settings(zones, **{"duration": 4.0, **sun, **values}))


def _send(simulation, quaternion, stamp_ns, rate=REST):
    goal = Goal(np.asarray(quaternion), np.asarray(rate, dtype=float), stamp_ns)
    return simulation.mission.set_goal(goal, simulation.now_ns)


def _told(simulation, stamp_ns):
    simulation.events += simulation.mission.take_events()
    return [e for e in simulation.events if e.goal is not None and e.goal.stamp_ns == stamp_ns]


def _codes(simulation, stamp_ns):
    return [event.code for event in _told(simulation, stamp_ns)]


def test_a_goal_arrives_when_the_setpoint_of_its_arrival_time_has_been_streamed():
    simulation = _simulation()
    _send(simulation, Z_TURN, 7)
    simulation.run(10.0, until=lambda: Code.ARRIVED in _codes(simulation, 7))
    flying, arrived = _told(simulation, 7)
    assert (flying.code, arrived.code) == (Code.FLYING, Code.ARRIVED)
    assert (flying.start_ns, flying.arrival_ns) == (arrived.start_ns, arrived.arrival_ns)
    assert flying.arrival_ns - flying.start_ns == 4 * SECOND
    streamed = simulation.setpoints[-1].stamp_ns
    assert 0 <= streamed - arrived.arrival_ns <= 0.2 * SECOND
    simulation.run(5.0)
    assert _codes(simulation, 7) == [Code.FLYING, Code.ARRIVED]


def test_another_goal_replaces_it_a_refused_one_does_not():
    simulation = _simulation()
    _send(simulation, Z_TURN, 1)
    simulation.run(1.0)
    assert not _send(simulation, AT_THE_SUN, 2)
    assert _codes(simulation, 2) == [Code.REFUSED]
    (refused,) = _told(simulation, 2)
    assert "sun" in refused.reason
    simulation.run(0.5)
    assert _codes(simulation, 1) == [Code.FLYING]
    _send(simulation, X_TURN, 3)
    simulation.run(6.0)
    assert _codes(simulation, 1) == [Code.FLYING, Code.REPLACED]
    assert _codes(simulation, 3) == [Code.FLYING, Code.ARRIVED]


def test_an_equal_goal_with_a_stamp_takes_over_the_plan():
    simulation = _simulation()
    _send(simulation, Z_TURN, 1)
    simulation.run(1.0)
    solves = simulation.solves
    assert _send(simulation, -Z_TURN, 2)
    assert not _send(simulation, Z_TURN, 2)
    assert _codes(simulation, 1) == [Code.FLYING, Code.REPLACED]
    (taken,) = _told(simulation, 2)
    assert taken.code is Code.FLYING
    assert taken.arrival_ns == simulation.mission.timeline.end_ns
    simulation.run(5.0)
    assert _codes(simulation, 2) == [Code.FLYING, Code.ARRIVED]
    assert _send(simulation, Z_TURN, 3)  # where it is already
    assert _codes(simulation, 3) == [Code.ARRIVED]
    assert simulation.solves == solves


def test_a_cancelled_goal_and_one_of_a_node_that_ends_are_cancelled():
    simulation = _simulation()
    _send(simulation, Z_TURN, 1)
    simulation.run(1.0)
    simulation.mission.cancel(simulation.now_ns)
    assert _codes(simulation, 1) == [Code.FLYING, Code.CANCELLED]
    _send(simulation, X_TURN, 2)
    simulation.run(1.0)
    simulation.mission.end(simulation.now_ns)
    assert _codes(simulation, 2)[-1] is Code.CANCELLED
    assert not _send(simulation, Z_TURN, 3)
    assert [event.reason[:8] for event in _told(simulation, 3)] == ["inactive"]
    simulation.run(4.0)
    assert not simulation.setpoints[-1].rate.any()
    simulation.mission.deactivate()
    assert not _send(simulation, Z_TURN, 4)
    assert _codes(simulation, 4) == [Code.REFUSED]


@pytest.mark.parametrize("autostart", [True, False])
def test_before_the_first_activation_the_newest_goal_is_kept_where_it_starts_by_itself(autostart):
    mission = Mission(settings(duration=4.0, autostart=autostart))
    for stamp_ns, turn in ((1, Z_TURN), (2, X_TURN)):
        mission.set_goal(Goal(turn, REST, stamp_ns), START_NS)
    codes = [(event.goal.stamp_ns, event.code) for event in mission.take_events()]
    if not autostart:
        assert codes == [(1, Code.REFUSED), (2, Code.REFUSED)]
        return
    assert codes == [(1, Code.WAITING), (1, Code.REPLACED), (2, Code.WAITING)]
    mission.activate(START_NS)
    assert mission.take_wanted().goal.stamp_ns == 2
    mission.deactivate()
    mission.take_events()
    mission.set_goal(Goal(Z_TURN, REST, 3), START_NS)
    assert [event.code for event in mission.take_events()] == [Code.REFUSED]


def test_a_kept_goal_is_dropped_by_cancel():
    mission = Mission(settings(duration=4.0))
    assert not mission.cancel(START_NS)[0]
    mission.set_goal(Goal(Z_TURN, REST, 1), START_NS)
    assert mission.cancel(START_NS)[0]
    assert mission.take_events()[-1].code is Code.CANCELLED
    mission.activate(START_NS)
    assert mission.take_wanted() is None


def test_what_was_told_outlives_activation_and_is_judged_then():
    mission = Mission(settings(("sun",), duration=4.0, sun__half_angle=0.3))
    mission.see_direction("zones/sun", np.array([0.0, 0.0, 1.0]), START_NS, START_NS)
    mission.see_obstacles(np.array([X_TURN]), START_NS, START_NS)
    mission.see_state(X_TURN, REST, START_NS, START_NS)
    mission.set_goal(Goal(AT_THE_SUN, REST, 1), START_NS)
    mission.activate(START_NS)
    assert mission.take_events()[-1].code is Code.REFUSED
    mission.deactivate()
    mission.activate(START_NS)
    assert len(mission.world.obstacles(START_NS)) == 2
    assert mission.measured.stamp_ns == START_NS


def test_a_zone_of_unknown_direction_is_told_at_activation_and_waited_for():
    simulation = _simulation(sun__direction=[])
    assert simulation.mission.take_events()[0].message.count("zone sun") == 1
    _send(simulation, Z_TURN, 1)
    simulation.run(2.0)
    simulation.zone("sun", [0.0, 0.0, 1.0])
    assert simulation.mission.pending is not None
    simulation.run(5.0)
    assert _codes(simulation, 1) == [Code.WAITING, Code.FLYING, Code.ARRIVED]


def test_before_a_simulated_clock_is_known_goals_and_zones_wait_and_keep_their_stamps():
    mission = Mission(settings(("sun", "moon"), duration=4.0, sun__max_speed=0.1))
    mission.activate(0)
    mission.see_direction("zones/sun", np.array([0.0, 0.0, 1.0]), 0, 0)
    mission.see_direction("zones/moon", np.array([0.0, 0.0, 1.0]), 95 * SECOND, 0)
    mission.set_goal(Goal(Z_TURN, REST, 5), 0)
    mission.wait_for_clock()
    assert mission.take_events()[-1].code is Code.WAITING
    assert mission.take_wanted() is None
    mission.tick(100 * SECOND)
    assert mission.take_wanted() is not None
    assert mission.world.age("zones/sun", 100 * SECOND) == 0.0
    assert mission.world.age("zones/moon", 100 * SECOND) == 5.0


def test_a_goal_whose_rate_is_past_the_limits_is_refused():
    simulation = _simulation(zones=(), limits_DOT_rate=0.1, duration=30.0)
    assert not _send(simulation, Z_TURN, 1, rate=[0.2, 0.0, 0.0])
    (refused,) = _told(simulation, 1)
    assert "limits.rate" in refused.reason


def test_every_outcome_of_a_solve_has_its_code_and_every_code_a_sentence():
    for status in Status:
        if status not in (Status.SOLVED, Status.CANCELLED):
            assert code_of(status).sentence == status.advice
    assert len({code.sentence for code in Code}) == len(Code)
    assert {code.name for code in Code if code.ends} == {
        "ARRIVED", "REPLACED", "CANCELLED", "REFUSED"
    }  # fmt: skip
