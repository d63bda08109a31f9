# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policy is the graph of the running nodes, both ways."""

import copy
import os

import pytest

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 101 + 1))


@pytest.mark.requirement("RP-030")
def test_the_policy_is_the_graph_of_the_running_nodes(tmp_path, monkeypatch):
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    from trust import policy

    running, stated = policy.running_graph(), policy.stated_graph()
    told = policy.differences(running, stated)
    assert not told, f"{told}; if that is meant: python -m trust.policy --write"
    less = copy.deepcopy(stated)
    less["riem_planner"]["subscribe"].remove("/riem_planner/goal")
    assert policy.differences(running, less)
    more = copy.deepcopy(stated)
    more["riem_monitor"]["publish"].append("/riem_planner/goal")
    assert policy.differences(running, more)


def test_the_policy_has_no_wildcard():
    from trust import policy

    assert "*" not in policy.POLICY.read_text(encoding="utf-8")
