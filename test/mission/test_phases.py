# SPDX-License-Identifier: Apache-2.0
"""The tables of the mission's states, and the pages that are made from them."""

from pathlib import Path

from riem_planner.mission.phases import COURSE, LIFE, Happening, Life, Order, Phase, diagram
from riem_planner.mission.reference import node_page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "node.md"


def test_every_order_is_answered_in_every_state_of_life():
    assert set(LIFE) == {(life, order) for life in Life for order in Order}
    assert {life for (_, order), life in LIFE.items() if order is Order.ACTIVATE} == {Life.ACTIVE}
    assert Life.NEW not in {then for (life, _), then in LIFE.items() if life is not Life.NEW}


def test_every_state_of_the_flight_is_reached_and_left():
    reached = {then for (phase, _), then in COURSE.items() if then is not phase}
    assert reached == set(Phase)
    for phase in Phase:
        assert COURSE[phase, Happening.DROP] is Phase.IDLE
        assert COURSE[phase, Happening.FLY] in (Phase.BOUND, Phase.RETURNING)


def test_only_a_way_out_leads_to_leaving_and_only_a_plan_to_the_goal():
    for (phase, happening), then in COURSE.items():
        if then in (Phase.BOUND, Phase.RETURNING) and then is not phase:
            assert happening in (Happening.FLY, Happening.CLEAR)
        if then in (Phase.LEAVING, Phase.RETURNING) and phase not in (
            Phase.LEAVING, Phase.RETURNING
        ):  # fmt: skip
            assert happening is Happening.WAY_OUT


def test_the_page_of_the_node_is_up_to_date():
    page = PAGE.read_text(encoding="utf-8")
    assert node_page(page) == page
    assert diagram() in page
