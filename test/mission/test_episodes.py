# SPDX-License-Identifier: Apache-2.0
"""Random episodes in simulated time: goals, moving zones, obstacles, cancels, bad messages.

Every setpoint is checked against the zones as last received one planning budget before, by
formulas of their own: nothing of the certificate or of the mission's world is used.
"""

import numpy as np
import pytest

pytest.importorskip("rclpy")

from episode import Episode
from simulation import discontinuities

from riem_planner.mission.safety import Judge


def _check(seeds, seconds, space="so3"):
    excused = checked = 0
    kinds, most = set(), 0
    for seed in seeds:
        episode = Episode(seed, space).run(seconds)
        jumps = discontinuities(episode.simulation.setpoints)
        assert not episode.faults, (seed, space, episode.faults[:3])
        assert not episode.jumps, (seed, space, episode.jumps[:3])
        assert not jumps, (seed, space, jumps[:1])
        assert episode.spoiled > 0
        excused += episode.excused
        checked += episode.checked
        kinds |= {sky.name for sky in episode.skies}
        most = max(most, len(episode.skies))
    assert checked > 0
    assert most > 1  # zones of several half-angles at once
    assert kinds == {"sun", "moon", "earth"}
    # A first plan may be asked for while the start is inside; that is a way out, and rare.
    assert excused <= 0.05 * checked


def test_no_setpoint_of_a_random_episode_enters_a_zone_or_jumps():
    _check(range(14), 30.0)


def test_nor_on_s2():
    _check([*range(110, 114), 10_962], 30.0, "s2")  # the last one rolled between samples once


def test_no_decision_that_comes_too_late_makes_the_reference_jump(monkeypatch):
    judged, episode, rng = Judge.timeline, None, np.random.default_rng(0)

    def now_and_then_slowly(judge, timeline):
        if rng.random() < 0.1:
            episode.simulation.stream_on(rng.choice([0.02, 0.06, 0.15, 0.4]))
        return judged(judge, timeline)

    monkeypatch.setattr(Judge, "timeline", now_and_then_slowly)
    codes = set()
    for seed in range(12):
        episode = Episode(seed, "so3" if seed % 4 else "s2")
        episode.run(15.0)
        assert not episode.jumps, (seed, episode.jumps[:3])
        assert not discontinuities(episode.simulation.setpoints), seed
        codes |= set(episode.simulation.codes())
    assert "LATE" in codes


@pytest.mark.soak
def test_ten_thousand_episodes():
    _check(range(1000, 10_000), 15.0)
    _check(range(10_000, 11_000), 15.0, "s2")
