# SPDX-License-Identifier: Apache-2.0
"""Which of the copies of a message counts, and what comes too late to."""

import pytest

pytest.importorskip("rclpy")

from riem_planner.node.hearing import REMEMBERED, Heard, Use, Way

SECOND = 1_000_000_000
NOW = 1_700_000_000 * SECOND


def _uses(*arrivals):
    heard = Heard()
    return [heard.use(NOW + round(sent * SECOND), way) for sent, way in arrivals]


def test_a_message_counts_once_whatever_ways_it_comes():
    ways = [Way.RELIABLE, Way.BEST_EFFORT, Way.LATCHED]
    assert _uses(*((1.0, way) for way in ways)) == [Use.NEW, Use.COPY, Use.COPY]


def test_a_latched_sender_that_repeats_its_history_replaces_nothing():
    told = [(1.0, Way.BEST_EFFORT), (30.0, Way.BEST_EFFORT)]
    history = [(-5.0, Way.LATCHED), (1.0, Way.LATCHED), (2.0, Way.LATCHED)]
    assert _uses(*told, *history)[2:] == [Use.LATE, Use.COPY, Use.LATE]


def test_a_latched_history_is_heard_in_its_order_where_nothing_is_known():
    assert _uses((1.0, Way.LATCHED), (2.0, Way.LATCHED)) == [Use.NEW, Use.NEW]


def test_a_message_that_was_lost_on_one_way_and_repeated_on_another_is_late():
    arrivals = [(1.0, Way.BEST_EFFORT), (0.9, Way.RELIABLE), (1.0, Way.RELIABLE)]
    assert _uses(*arrivals) == [Use.NEW, Use.LATE, Use.COPY]


def test_senders_whose_clocks_differ_are_both_heard():
    arrivals = [(100.0, Way.BEST_EFFORT), (91.0, Way.BEST_EFFORT), (101.0, Way.BEST_EFFORT)]
    assert _uses(*arrivals) == [Use.NEW] * 3
    assert _uses((100.0, Way.BEST_EFFORT), (91.0, Way.RELIABLE)) == [Use.NEW] * 2


def test_a_middleware_that_tells_no_times_loses_nothing():
    heard = Heard()
    assert [heard.use(0, way) for way in Way] == [Use.NEW] * 3


def test_what_is_remembered_is_bounded():
    heard = Heard()
    for k in range(3 * REMEMBERED):
        assert heard.use(NOW + k, Way.BEST_EFFORT) is Use.NEW
    assert len(heard._known) == REMEMBERED
