# SPDX-License-Identifier: Apache-2.0
"""What the node does about goals, changes of the world and faults, without ROS."""

import numpy as np
import pytest
from simulation import SECOND, Simulation, discontinuities, settings

from riem_planner.geometry import so3
from riem_planner.mission import recovery
from riem_planner.mission.codes import Code, Level
from riem_planner.mission.safety import Judge
from riem_planner.mission.timeline import Purpose
from riem_planner.node.reports import samples_of
from riem_planner.solution import Status

Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.5]))
X_TURN = so3.quaternion_exp(np.array([1.0, 0.2, 0.0]))


def _simulation(zones=("sun",), **values):
    given = {"duration": 10.0, "sun__direction": [0.0, 0.0, 1.0], "sun__half_angle": 0.3}
    if "sun" not in zones:
        given = {"duration": 10.0}
    timing = {key: values.pop(key) for key in ("solve_time", "period") if key in values}
    return Simulation(settings(zones, **{**given, **values}), **timing)


def _attitude(simulation):
    return so3.quaternion_to_matrix(simulation.setpoints[-1].quaternion)


def _certified(simulation):
    judge = Judge(simulation.mission.world, simulation.mission.settings, simulation.now_ns)
    return judge.timeline(simulation.mission.timeline).certified


def _distance_to(simulation, quaternion):
    return float(so3.quaternion_distance(simulation.setpoints[-1].quaternion, quaternion))


def test_nothing_is_streamed_before_the_first_plan():
    simulation = _simulation()
    simulation.run(1.0)
    assert not simulation.setpoints
    assert simulation.doing() == "idle"


def test_a_goal_is_flown_to_and_its_end_is_held():
    simulation = _simulation()
    assert simulation.goal(Z_TURN)
    simulation.run(12.0)
    assert "FLYING" in simulation.codes()
    assert simulation.doing() == "holding"
    assert _distance_to(simulation, Z_TURN) < 1e-9
    assert not simulation.setpoints[-1].rate.any()
    assert not discontinuities(simulation.setpoints)


def test_the_first_setpoint_comes_as_soon_as_the_plan_is_ready():
    simulation = _simulation(solve_time=0.005)
    simulation.goal(Z_TURN)
    begin = simulation.now_ns
    simulation.run(1.0, until=lambda: bool(simulation.setpoints))
    assert simulation.setpoints[0].stamp_ns - begin <= 0.05 * SECOND


def test_the_same_goal_again_changes_nothing():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(2.0)
    solves = simulation.solves
    assert not simulation.goal(Z_TURN)
    assert not simulation.goal(-Z_TURN)
    simulation.run(0.5)
    assert simulation.solves == solves


def test_a_new_goal_in_mid_slew_is_spliced_without_a_jump():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    before = simulation.now_ns
    simulation.goal(-X_TURN)
    splice = before + simulation.mission.settings.budget_ns
    simulation.run(0.08)
    starts = [segment.start_ns for segment in simulation.mission.timeline.segments]
    assert splice in starts
    old, new = simulation.mission.timeline.segments[-2:]
    left, right = old.at(splice), new.at(splice)
    assert np.abs(left.quaternion - right.quaternion).max() < 1e-9
    assert np.abs(left.rate - right.rate).max() < 1e-9
    simulation.run(13.0)
    assert _distance_to(simulation, X_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


def test_the_newest_goal_wins():
    simulation = _simulation(solve_time=0.06)
    simulation.goal(Z_TURN)
    simulation.step()
    simulation.goal(X_TURN)
    simulation.run(12.0)
    assert _distance_to(simulation, X_TURN) < 1e-9
    assert simulation.codes().count("FLYING") == 1


def test_a_plan_that_is_late_is_planned_anew_from_a_later_point():
    simulation = _simulation(solve_time=0.01)
    simulation.goal(Z_TURN)
    simulation.run(3.0)
    simulation.solve_time_ns = round(0.25 * SECOND)
    simulation.goal(X_TURN)
    simulation.run(14.0)
    assert "LATE" in simulation.codes()
    assert _distance_to(simulation, X_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


@pytest.mark.parametrize("seconds", [0.04, 0.1, 0.3])
def test_on_a_busy_machine_nothing_that_was_streamed_is_changed(monkeypatch, seconds):
    simulation = _simulation()
    judged = Judge.timeline

    def slowly(judge, timeline):
        simulation.stream_on(seconds)
        return judged(judge, timeline)

    monkeypatch.setattr(Judge, "timeline", slowly)
    simulation.goal(Z_TURN)
    simulation.run(2.0, until=lambda: simulation.doing() == "slewing")
    simulation.run(1.0)
    simulation.zone("sun", so3.exp(np.array([0.0, 0.0, 1.0])) @ np.array([1.0, 0.0, 0.05]))
    assert _certified(simulation)
    simulation.run(2.0)
    assert simulation.doing() == "slewing"  # anew
    simulation.goal(X_TURN)
    simulation.run(3.0)
    assert simulation.codes()[-1] == "FLYING"
    _, message = simulation.mission.cancel(simulation.now_ns)
    assert "certified stop" in message
    simulation.run(8.0)
    assert simulation.doing() == "holding"
    assert not simulation.setpoints[-1].rate.any()
    assert not discontinuities(simulation.setpoints)


def test_a_machine_too_busy_to_find_what_is_safe_tries_again(monkeypatch):
    simulation = _simulation(duration=60.0)
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    flown = simulation.mission.timeline.last
    judged, busy = Judge.timeline, [1.5]

    def slowly(judge, timeline):
        simulation.stream_on(busy[0])
        return judged(judge, timeline)

    monkeypatch.setattr(Judge, "timeline", slowly)
    ahead = so3.exp(np.array([0.0, 0.0, 1.49])) @ np.array([1.0, 0.0, 0.25])
    simulation.zone("sun", ahead)
    assert [event.code for event in simulation.mission.take_events()] == [Code.LATE]
    assert simulation.mission.timeline.last is flown
    busy[0] = 0.0
    simulation.step()
    assert _certified(simulation)
    assert simulation.mission.timeline.last is not flown
    simulation.run(60.0)
    assert not discontinuities(simulation.setpoints)


def test_a_stop_that_comes_too_late_is_tried_again_unless_a_new_goal_comes(monkeypatch):
    for anew in (False, True):
        simulation = _simulation(duration=60.0)
        simulation.goal(Z_TURN)
        simulation.run(1.0)
        flown = simulation.mission.timeline.last
        with monkeypatch.context() as busy:
            judged = Judge.timeline

            def slowly(judge, timeline, simulation=simulation, judged=judged):
                simulation.stream_on(1.5)
                return judged(judge, timeline)

            busy.setattr(Judge, "timeline", slowly)
            _, message = simulation.mission.cancel(simulation.now_ns)
            assert "too busy" in message
            assert simulation.mission.timeline.last is flown
            if anew:
                assert simulation.goal(Z_TURN)
        simulation.run(1.0)
        if anew:
            assert simulation.doing() == "slewing"
        else:
            assert simulation.mission.timeline.last is not flown
            simulation.run(30.0)
            assert simulation.doing() == "holding"
            assert _distance_to(simulation, Z_TURN) > 0.1
        assert not discontinuities(simulation.setpoints)


def test_what_is_crossed_before_a_late_rescue_is_told(monkeypatch):
    simulation = _simulation(duration=60.0, sun__half_angle=0.004)
    simulation.goal(Z_TURN)
    simulation.run(28.0)
    rescue, late = recovery.rescue, [0.3, 0.5, 0.7, 0.0]

    def slowly(*given):
        found = rescue(*given)
        simulation.stream_on(late.pop(0))
        return found

    monkeypatch.setattr(recovery, "rescue", slowly)
    # The sun is crossed after what is streamed meanwhile, before what is found may begin.
    rate = _attitude(simulation) @ simulation.setpoints[-1].rate
    boresight = _attitude(simulation) @ np.array([1.0, 0.0, 0.0])
    simulation.zone("sun", so3.exp(rate * (1.5 + 0.4)) @ boresight)
    assert not late
    assert simulation.mission.timeline.last.purpose is Purpose.STOP
    event = simulation.mission.take_events()[-1]
    assert (event.code, event.level) == (Code.STOP, Level.ERROR)
    assert "what flies before it is not certified" in event.message
    assert not simulation.mission.verdict.certified
    assert not discontinuities(simulation.setpoints)


def test_a_call_that_is_overtaken_by_the_stream_is_no_jump_of_the_clock():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    now_ns = simulation.now_ns
    simulation.stream_on(0.4)
    simulation.mission.see_direction("zones/sun", np.array([0.0, 0.0, 1.0]), now_ns, now_ns)
    simulation.run(12.0)
    assert "CLOCK_JUMP" not in simulation.codes()
    assert _distance_to(simulation, Z_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


def test_the_clock_jumps_over_the_beginning_of_a_later_segment():
    simulation = _simulation()
    simulation.goal(Z_TURN, rate=(0.0, 0.0, 0.1))  # a slew, and a stop after it
    simulation.run(1.0)
    assert len(simulation.mission.timeline.segments) == 3  # it is followed in between
    before = simulation.setpoints[-1]
    simulation.now_ns += 30 * SECOND
    simulation.step()
    after = simulation.setpoints[-1]
    assert after.stamp_ns == simulation.now_ns
    assert so3.quaternion_distance(before.quaternion, after.quaternion) < 0.01
    simulation.run(30.0)
    assert "CLOCK_JUMP" in simulation.codes()
    assert simulation.doing() == "holding"


def test_a_cancel_before_anything_has_begun_leaves_nothing_to_fly():
    simulation = _simulation(zones=(), start_orientation=[0.0, 0.0, 0.0, 1.0])
    rate = np.array([0.0, 0.0, 0.05])
    now_ns = simulation.now_ns
    simulation.mission.see_state(np.array([0.0, 0.0, 0.0, 1.0]), rate, now_ns, now_ns)
    simulation.goal(Z_TURN)
    simulation.run(1.0, until=lambda: bool(simulation.mission.timeline))
    assert simulation.mission.timeline.segments[0].start_ns > simulation.now_ns
    done, message = simulation.mission.cancel(simulation.now_ns)
    assert done
    assert "nothing had begun" in message
    assert not simulation.mission.timeline


def test_an_inactive_mission_keeps_the_time():
    simulation = _simulation()
    mission = simulation.mission
    mission.deactivate()
    simulation.zone("sun", [0.0, 1.0, 0.0])
    for _ in range(100):
        simulation.step()
    mission.activate(simulation.now_ns)
    assert mission.world.age("zones/sun", simulation.now_ns) == pytest.approx(2.0)


def test_cancel_comes_to_rest_along_a_certified_stop_and_holds():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    done, message = simulation.mission.cancel(simulation.now_ns)
    assert done
    assert "certified stop" in message
    assert _certified(simulation)
    simulation.run(10.0)
    assert simulation.doing() == "holding"
    assert _distance_to(simulation, Z_TURN) > 0.1
    assert not simulation.setpoints[-1].rate.any()
    assert not discontinuities(simulation.setpoints)
    # It is not gone back to, but it may be sent again.
    assert simulation.goal(Z_TURN)


def test_a_zone_that_moves_into_the_way_is_gone_around_in_the_same_time():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    arrival = simulation.mission.timeline.end_ns
    simulation.zone("sun", so3.exp(np.array([0.0, 0.0, 1.0])) @ np.array([1.0, 0.0, 0.05]))
    assert _certified(simulation)  # at once: a stop before the zone, till the new plan is there
    simulation.run(0.2)
    assert _certified(simulation)
    assert simulation.mission.timeline.end_ns == pytest.approx(arrival, abs=1000)
    simulation.run(12.0)
    assert _distance_to(simulation, Z_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


def test_a_zone_elsewhere_changes_nothing():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    before = simulation.mission.timeline.last
    simulation.zone("sun", [0.0, 0.05, 1.0])
    simulation.run(0.5)
    assert simulation.mission.timeline.last is before


def test_a_goal_in_a_zone_is_refused_with_its_name_and_the_old_plan_goes_on():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(2.0)
    simulation.goal(so3.quaternion_exp(np.array([0.0, -1.5, 0.0])))  # the boresight at the sun
    simulation.run(12.0)
    event = next(event for event in simulation.events if event.code is Code.REFUSED)
    advice = Status.GOAL_IN_ZONE.advice
    assert event.message.count(advice) == 1
    assert "sun" in event.message
    assert "stays" in event.message
    assert _distance_to(simulation, Z_TURN) < 1e-9


def test_a_zone_that_seals_the_goal_leaves_a_certified_stop():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    simulation.zone("sun", so3.exp(np.array([0.0, 0.0, 1.6])) @ np.array([1.0, 0.0, 0.0]))
    assert _certified(simulation)
    simulation.run(10.0)
    assert simulation.doing() == "holding"
    assert simulation.mission.world.obstacles(0)[0].distance(_attitude(simulation)) > 0.3
    # Once it moves away, the goal is gone to.
    simulation.zone("sun", [0.0, 0.0, 1.0])
    simulation.run(14.0)
    assert _distance_to(simulation, Z_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


def test_a_zone_that_comes_over_the_held_attitude_is_left_the_shortest_way():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(12.0)
    place = _attitude(simulation) @ np.array([1.0, 0.05, 0.0])
    begin = len(simulation.setpoints)
    simulation.zone("sun", place)
    simulation.run(10.0)
    event = next(event for event in simulation.events if event.code is Code.WAY_OUT)
    assert "inside sun" in event.message
    margins = [
        float(
            np.arccos(
                np.clip(
                    (so3.quaternion_to_matrix(s.quaternion)[:, 0]) @ place / np.linalg.norm(place),
                    -1,
                    1,
                )
            )
        )
        - 0.3
        for s in simulation.setpoints[begin:]
    ]
    leaving = [m for m in margins if m <= 0.0]
    assert np.all(np.diff(leaving) > -1e-6)
    assert margins[-1] > 0.0
    assert not discontinuities(simulation.setpoints)


@pytest.mark.parametrize("when", [12.0, 3.0])
def test_the_way_out_keeps_the_limits_and_says_which_one_binds(when):
    limits = {"limits_DOT_rate": 0.105, "limits_DOT_acceleration": 0.05}
    simulation = _simulation(duration=30.0, **limits)
    simulation.goal(Z_TURN)
    simulation.run(when)
    begin = len(simulation.setpoints)
    simulation.zone("sun", _attitude(simulation) @ np.array([1.0, 0.05, 0.02]))
    simulation.run(12.0)
    event = next(event for event in simulation.events if event.code is Code.WAY_OUT)
    assert "bound by limits." in event.message
    assert "deg/s" in event.message
    for setpoint in simulation.setpoints[begin:]:
        assert np.linalg.norm(setpoint.rate) <= 0.105 + 1e-9
        assert np.linalg.norm(setpoint.acceleration) <= 0.05 + 1e-6
    assert not discontinuities(simulation.setpoints)


def test_a_zone_that_drifts_over_a_held_attitude_is_dodged_before_it_arrives():
    simulation = _simulation(sun__rate=[0.0, 0.02, 0.0], sun__direction=[0.9, 0.0, 1.0])
    start = [0.0, 0.0, 0.0, 1.0]
    simulation.goal(so3.quaternion_exp(np.array([0.001, 0.0, 0.0])))
    simulation.run(60.0)
    assert not discontinuities(simulation.setpoints)
    world, zone = simulation.mission.world, simulation.mission.settings.zones[0]
    for setpoint in simulation.setpoints:
        placed = world.zone_at(zone, setpoint.stamp_ns)
        assert placed.half_angle == 0.3
    # The parameter's direction turns with the rate from the start of each judgement on, so that
    # it is enough that no way out had to be flown.
    assert "WAY_OUT" not in simulation.codes()
    assert start is not None


def test_with_auto_execute_off_a_plan_is_shown_and_flown_only_when_told():
    simulation = _simulation(auto_execute=False)
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    assert not simulation.setpoints
    assert "SHOWN" in simulation.codes()
    done, _ = simulation.mission.execute(simulation.now_ns)
    assert done
    simulation.run(12.0)
    assert _distance_to(simulation, Z_TURN) < 1e-9
    # From the hold on, too; and in mid-slew from where the reference is by then.
    simulation.goal(X_TURN)
    simulation.run(3.0)
    assert simulation.doing() == "holding"
    assert simulation.mission.execute(simulation.now_ns)[0]
    simulation.run(3.0)
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    assert simulation.mission.execute(simulation.now_ns)[0]
    simulation.run(14.0)
    assert _distance_to(simulation, Z_TURN) < 1e-9
    assert not discontinuities(simulation.setpoints)


def test_execute_refuses_what_is_no_longer_certified():
    simulation = _simulation(auto_execute=False)
    simulation.goal(Z_TURN)
    simulation.run(1.0)
    simulation.zone("sun", so3.exp(np.array([0.0, 0.0, 0.8])) @ np.array([1.0, 0.0, 0.0]))
    done, message = simulation.mission.execute(simulation.now_ns)
    assert not done
    assert "sun" in message
    simulation.run(1.0)
    assert not simulation.setpoints
    assert simulation.mission.execute(simulation.now_ns)[0]  # the new one


def test_execute_without_a_plan_is_refused():
    simulation = _simulation(auto_execute=False)
    assert not simulation.mission.execute(simulation.now_ns)[0]


def test_the_published_samples_of_a_plan_are_what_is_streamed_its_stop_included():
    simulation = _simulation()
    simulation.goal(Z_TURN, np.array([0.0, 0.01, 0.02]))
    simulation.run(0.5)
    proposal = next(event.proposal for event in simulation.events if event.code is Code.FLYING)
    samples = samples_of(proposal, 57)
    begin = proposal.segments[0].start_ns
    for time, *state in zip(*samples, strict=True):
        streamed = simulation.mission.timeline.at(begin + round(time * 1e9))
        for ours, theirs in zip(state, streamed[1:], strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-14)


def test_the_first_plan_begins_at_the_measured_state_its_motion_included():
    simulation = _simulation()
    rate = np.array([0.0, 0.0, 0.02])
    simulation.mission.see_state(Z_TURN, rate, simulation.now_ns, simulation.now_ns)
    begin = simulation.now_ns
    simulation.goal(X_TURN)
    simulation.run(0.3)
    first = simulation.setpoints[0]
    elapsed = (first.stamp_ns - begin) * 1e-9
    expected = so3.quaternion_multiply(Z_TURN, so3.quaternion_exp(rate * elapsed))
    assert so3.quaternion_distance(first.quaternion, expected) < 1e-4
    assert np.linalg.norm(first.rate - rate) < 1e-2


def test_require_state_waits_for_one():
    simulation = _simulation(require_state=True)
    simulation.goal(Z_TURN)
    simulation.run(2.0)
    assert not simulation.setpoints
    assert simulation.codes() == ["WAITING"]
    simulation.mission.see_state(X_TURN, np.zeros(3), simulation.now_ns, simulation.now_ns)
    simulation.run(0.2)
    assert simulation.setpoints


def test_a_zone_without_direction_is_waited_for():
    simulation = _simulation(sun__direction=[])
    simulation.goal(Z_TURN)
    simulation.run(2.0)
    assert not simulation.setpoints
    assert "no direction is known of zone sun" in simulation.events[0].message
    simulation.zone("sun", [0.0, 0.0, 1.0])
    simulation.run(2.0)
    assert simulation.setpoints


@pytest.mark.parametrize("jump", [-3600.0, -1.0, 2.0, 86400.0])
def test_after_a_jump_of_the_clock_the_stream_goes_on_from_where_it_was(jump):
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    before = simulation.setpoints[-1]
    simulation.now_ns += round(jump * SECOND)
    simulation.step()
    after = simulation.setpoints[-1]
    assert so3.quaternion_distance(before.quaternion, after.quaternion) < 0.01
    assert np.abs(before.rate - after.rate).max() < 0.01
    simulation.step()
    assert "CLOCK_JUMP" in simulation.codes()
    simulation.run(10.0)
    assert _distance_to(simulation, Z_TURN) < 1e-9


def test_a_clock_that_is_set_back_behind_a_stream_that_ran_ahead_makes_no_step_back():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    simulation.stream_on(0.2)  # since the last call that was told the time
    before = simulation.setpoints[-1]
    simulation.now_ns -= 50 * SECOND
    simulation.mission.advance(simulation.now_ns)
    after = simulation.mission.reference.stream(simulation.now_ns)
    assert so3.quaternion_distance(before.quaternion, after.quaternion) < 1e-12


def test_a_clock_that_stands_still_changes_nothing():
    simulation = _simulation()
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    before = simulation.mission.timeline.at(simulation.now_ns)
    for _ in range(100):
        simulation.mission.tick(simulation.now_ns)
    after = simulation.mission.timeline.at(simulation.now_ns)
    assert np.array_equal(before.quaternion, after.quaternion)


def test_a_zone_not_heard_of_grows_once_its_timeout_is_over():
    simulation = _simulation(sun__timeout=1.0, sun__max_speed=0.1)
    world, zone = simulation.mission.world, simulation.mission.settings.zones[0]
    simulation.zone("sun", [0.0, 0.0, 1.0])
    at = simulation.now_ns
    assert world.zone_at(zone, at + SECOND).half_angle == 0.3
    assert world.stale(at + SECOND) == ()
    grown = world.zone_at(zone, at + 3 * SECOND).half_angle
    assert 0.3 + 0.2 <= grown <= 0.3 + 0.2 + 0.1 * 0.3
    assert world.stale(at + 3 * SECOND) == ("zones/sun",)


@pytest.mark.parametrize("turning", [[0.0, 0.0, 0.01], [0.003, -0.002, 0.0]])
def test_the_rate_of_a_zone_is_estimated_from_its_updates(turning):
    simulation = _simulation()
    world, zone = simulation.mission.world, simulation.mission.settings.zones[0]
    first = np.array([0.6, 0.0, 0.8])
    for k in range(100):
        now_ns = simulation.now_ns + k * 50_000_000
        direction = so3.exp(np.array(turning) * k * 0.05) @ first
        world.update("zones/sun", direction, now_ns)
    later = world.zone_at(zone, now_ns + 2 * SECOND)
    expected = so3.exp(np.array(turning) * (99 * 0.05 + 2.0)) @ first
    assert np.linalg.norm(later.direction - expected) < 2e-3


def test_a_leap_of_a_zone_is_not_taken_for_motion():
    simulation = _simulation()
    world, zone = simulation.mission.world, simulation.mission.settings.zones[0]
    world.update("zones/sun", np.array([0.0, 0.0, 1.0]), simulation.now_ns)
    world.update("zones/sun", np.array([1.0, 0.0, 0.0]), simulation.now_ns + SECOND)
    assert not world.zone_at(zone, simulation.now_ns + SECOND).rate.any()


def test_older_data_of_a_zone_is_not_taken():
    simulation = _simulation()
    world = simulation.mission.world
    assert world.update("zones/sun", np.array([0.0, 0.0, 1.0]), simulation.now_ns)
    assert not world.update("zones/sun", np.array([0.0, 1.0, 0.0]), simulation.now_ns - 1)


def test_a_parameter_that_makes_the_flight_unsafe_is_acted_on_at_once():
    simulation = _simulation(sun__direction=[0.3, 1.0, 0.0])
    simulation.goal(X_TURN)
    simulation.run(12.0)
    simulation.goal(Z_TURN)
    simulation.run(0.5)
    wider = settings(("sun",), duration=10.0, sun__direction=[0.3, 1.0, 0.0], sun__half_angle=0.02)
    simulation.mission.configure(wider, simulation.now_ns)
    assert _certified(simulation)


def test_limits_are_kept_by_plans_and_a_least_duration_is_found():
    simulation = _simulation(duration=0.0, limits_DOT_rate=0.1, limits_DOT_acceleration=0.02)
    simulation.goal(Z_TURN)
    simulation.run(40.0)
    speeds = [np.linalg.norm(s.rate) for s in simulation.setpoints]
    assert 0.05 < max(speeds) <= 0.1 + 1e-9
    assert _distance_to(simulation, Z_TURN) < 1e-9


def test_on_s2_the_boresight_gets_there_without_roll():
    simulation = _simulation(space="s2", sun__half_angle=0.2)
    simulation.goal(Z_TURN)
    simulation.run(4.0)
    simulation.goal(so3.quaternion_exp(np.array([0.0, 0.5, 0.3])))
    simulation.run(2.0)
    simulation.mission.cancel(simulation.now_ns)
    simulation.run(2.0)
    simulation.goal(Z_TURN)
    simulation.run(14.0)
    aimed = so3.quaternion_to_matrix(Z_TURN)[:, 0]
    assert np.linalg.norm(_attitude(simulation)[:, 0] - aimed) < 1e-9
    assert max(abs(float(s.rate[0])) for s in simulation.setpoints) < 1e-5
    assert not discontinuities(simulation.setpoints)


def test_a_goal_while_inactive_is_refused():
    simulation = _simulation()
    simulation.mission.deactivate()
    assert not simulation.goal(Z_TURN)
    simulation.run(0.5)
    assert simulation.codes() == ["REFUSED"]
    assert not simulation.setpoints
