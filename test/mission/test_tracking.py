# SPDX-License-Identifier: Apache-2.0
"""Goals that move: met at their rate, followed, corrected as told, left when they fall silent."""

import numpy as np
import pytest
from simulation import SECOND, Simulation, discontinuities, settings

from riem_planner.geometry import so3
from riem_planner.mission.codes import Code
from riem_planner.mission.planning import Goal
from riem_planner.mission.safety import Judge
from riem_planner.mission.timeline import Setpoint, Timeline
from riem_planner.mission.tracking import bend, followed

FIRST = so3.quaternion_exp(np.array([0.2, 0.3, 1.0]))
RATE = np.radians(0.5) * np.array([0.6, -0.48, 0.64])
TOLD = Goal(FIRST, RATE)
ERROR = np.radians(0.05)


class Target:
    """A target that turns as it does, and is told of now and then."""

    def __init__(self, simulation, rate=RATE):
        self.simulation, self.rate, self.begin_ns = simulation, rate, simulation.now_ns

    def at(self, time_ns):
        turn = so3.quaternion_exp(self.rate * ((time_ns - self.begin_ns) * 1e-9))
        return so3.quaternion_multiply(FIRST, turn)

    def tell(self, noise=(0.0, 0.0, 0.0)):
        now_ns = self.simulation.now_ns
        q = so3.quaternion_multiply(self.at(now_ns), so3.quaternion_exp(np.array(noise)))
        goal = Goal(q, self.rate, now_ns, "~/goal_state", now_ns, now_ns)
        return self.simulation.mission.set_goal(goal, now_ns)

    def told_for(self, seconds, noise=lambda: (0.0, 0.0, 0.0)):
        for _ in range(seconds):
            self.tell(noise())
            self.simulation.run(1.0)

    def errors(self, from_ns):
        return [
            float(so3.quaternion_distance(self.at(s.stamp_ns), s.quaternion))
            for s in self.simulation.setpoints
            if s.stamp_ns >= from_ns
        ]


def _arrival(simulation):
    return next(e.arrival_ns for e in simulation.events if e.code is Code.ARRIVED)


@pytest.mark.parametrize(
    "values",
    [
        {"duration": 8.0},
        {"duration": 0.0, "limits_DOT_rate": 0.3, "limits_DOT_acceleration": 0.1},
    ],
)
def test_it_is_met_at_its_rate_and_followed_as_long_as_it_is_told_of(values):
    simulation = Simulation(settings(**values))
    target = Target(simulation)
    target.told_for(30)
    assert simulation.codes() == ["FLYING", "ARRIVED"]
    assert simulation.events[0].goal.stamp_ns == target.begin_ns
    assert simulation.events[0].arrival_ns == _arrival(simulation)
    assert max(target.errors(_arrival(simulation))) < ERROR
    met = next(s for s in simulation.setpoints if s.stamp_ns >= _arrival(simulation))
    assert met.rate == pytest.approx(RATE, abs=1e-6)
    assert simulation.doing() == "tracking"
    assert not discontinuities(simulation.setpoints)


def test_corrections_are_taken_up_without_an_event_or_a_jump():
    simulation = Simulation(settings(duration=8.0))
    target, rng = Target(simulation), np.random.default_rng(1)
    target.told_for(20, lambda: rng.normal(size=3) * 1e-3)
    told = [event.code for event in simulation.events]
    assert told == [Code.FLYING, Code.ARRIVED]
    assert max(target.errors(_arrival(simulation) + SECOND)) < 6e-3
    assert not discontinuities(simulation.setpoints, 1e-8)
    # One that is told truly again is followed truly again.
    target.told_for(4)
    last_ns = simulation.now_ns - SECOND
    assert max(target.errors(last_ns)) < ERROR
    # Farther off, it is another goal.
    assert target.tell((0.1, 0.0, 0.0))


def test_one_that_falls_silent_is_left_by_a_certified_stop_and_taken_up_again():
    simulation = Simulation(settings(duration=4.0, tracking_timeout=3.0))
    target = Target(simulation)
    target.tell()
    simulation.run(20.0)
    assert [event.code for event in simulation.events] == [Code.FLYING, Code.ARRIVED, Code.STOP]
    assert simulation.doing() == "holding"
    assert not simulation.setpoints[-1].rate.any()
    stopped = next(s for s in reversed(simulation.setpoints) if s.rate.any())
    assert 3.0 < (stopped.stamp_ns - _arrival(simulation)) * 1e-9 < 10.0
    target.told_for(8)
    assert simulation.doing() == "tracking"
    assert max(target.errors(simulation.now_ns - SECOND)) < ERROR
    ends = [event.code for event in simulation.events if event.code.ends]
    assert ends == [Code.ARRIVED]
    assert not discontinuities(simulation.setpoints)


def test_a_zone_on_the_targets_way_is_never_entered():
    turned = so3.quaternion_to_matrix(FIRST) @ so3.exp(15.0 * RATE)
    place = (turned @ np.array([1.0, 0.0, 0.0])).tolist()
    simulation = Simulation(
        settings(("sun",), duration=5.0, sun__direction=place, sun__half_angle=0.05)
    )
    target = Target(simulation)
    target.told_for(40)
    (zone,) = simulation.mission.world.obstacles(simulation.now_ns)
    for setpoint in simulation.setpoints:
        attitude = so3.quaternion_to_matrix(setpoint.quaternion)
        assert zone.distance(attitude, np.asarray(0.0)) > 0.05
    codes = {event.code for event in simulation.events}
    assert Code.ARRIVED in codes
    assert Code.STOP in codes
    assert not discontinuities(simulation.setpoints)


def test_what_is_followed_is_certified_ahead():
    simulation = Simulation(settings(("sun",), duration=5.0, sun__direction=[0.0, 0.0, 1.0]))
    Target(simulation).told_for(8)
    mission = simulation.mission
    judge = Judge(mission.world, mission.settings, simulation.now_ns)
    assert judge.timeline(mission.timeline).certified
    ahead = (mission.timeline.last.start_ns - simulation.now_ns) * 1e-9
    assert ahead > mission.settings.tracking_timeout - 1.1


def test_on_s2_the_boresight_follows_and_hardly_rolls():
    simulation = Simulation(settings(space="s2", duration=6.0))
    rate = np.array([0.0, 0.006, -0.005])  # across the boresight
    target = Target(simulation, rate)
    target.told_for(14)
    begin_ns = _arrival(simulation)
    for setpoint in simulation.setpoints:
        if setpoint.stamp_ns >= begin_ns:
            told = so3.quaternion_to_matrix(target.at(setpoint.stamp_ns))[:, 0]
            flown = so3.quaternion_to_matrix(setpoint.quaternion)[:, 0]
            assert np.linalg.norm(told - flown) < ERROR
    # Where a turn is bent, it rolls by about the angle that it is bent by times its rate.
    assert max(abs(float(s.rate[0])) for s in simulation.setpoints) < 3e-4
    assert not discontinuities(simulation.setpoints)


def test_a_bent_way_begins_as_it_did_and_ends_where_it_is_told_to():
    start = Setpoint(0, FIRST, np.array([0.02, 0.01, -0.03]), np.zeros(3))
    from riem_planner.mission.timeline import Purpose, Segment

    base = Timeline((Segment(0, followed(start, 20.0), Purpose.TRACK),))
    end_ns = 12 * SECOND
    there = so3.quaternion_multiply(base.at(end_ns).quaternion, so3.quaternion_exp([0.03, 0, 0.02]))
    rate = np.array([0.01, 0.02, -0.02])
    way = bend(base, 4 * SECOND, end_ns, (there, rate))
    first, last = base.at(4 * SECOND), way.evaluate_quaternion(way.duration)
    assert np.allclose(way.quaternions_xyzw[0], first.quaternion, atol=1e-14)
    assert np.allclose(way.angular_velocities[0], first.rate, atol=1e-14)
    assert so3.quaternion_distance(last[0], there) < 1e-9
    assert np.allclose(last[1], rate, atol=1e-9)
    # Rates are the derivative of attitudes, accelerations that of rates.
    times = np.linspace(0.0, way.duration, 2001)
    R, v, a = way.evaluate(times)
    h = times[1]
    turned = so3.log(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / h
    assert np.abs(turned - 0.5 * (v[1:] + v[:-1])).max() < 1e-6
    assert np.abs(np.diff(v, axis=0) / h - 0.5 * (a[1:] + a[:-1])).max() < 1e-4
    for k in (7, 20):
        assert np.allclose(way.evaluate(way.times[k])[2], way.angular_accelerations[k], atol=1e-12)


def test_a_goal_that_turns_is_the_same_goal_if_its_motion_is():
    later = Goal(TOLD.at(3 * SECOND), RATE, 3 * SECOND)
    assert TOLD.equals(later)
    assert not TOLD.equals(Goal(FIRST, RATE, 3 * SECOND))
