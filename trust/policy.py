# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policy of the three nodes, made from the graph of the running nodes.

`python -m trust.policy` compares config/security/policy.xml with the nodes that run with
config/demo.yaml, both ways; `--write` makes it anew. It needs no DDS security.
"""

from __future__ import annotations

import argparse
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
POLICY = ROOT / "config/security/policy.xml"
PARAMETERS = ROOT / "config/demo.yaml"
_KINDS = (
    ("topics", "publish", "topic", "get_publisher_names_and_types_by_node"),
    ("topics", "subscribe", "topic", "get_subscriber_names_and_types_by_node"),
    ("services", "reply", "service", "get_service_names_and_types_by_node"),
    ("services", "request", "service", "get_client_names_and_types_by_node"),
)
_SETTLED = 1.0  # s in which a node's own graph has come

Graph = dict[str, dict[str, list[str]]]


def running_graph(seconds: float = _SETTLED) -> Graph:
    """Names of topics and services, by node and by what is done with them."""
    import rclpy
    from rclpy.context import Context

    from riem_planner.monitor_node.monitor_node import MonitorNode
    from riem_planner.node.planner_node import PlannerNode
    from riem_planner.spacecraft_sim.spacecraft_node import SpacecraftNode

    context = Context()
    rclpy.init(
        args=["--ros-args", "--params-file", str(PARAMETERS), "-p", "autostart:=false"],
        context=context,
    )
    nodes: list[Any] = []
    try:
        for kind in (PlannerNode, MonitorNode, SpacecraftNode):
            nodes.append(kind(context=context))
        time.sleep(seconds)
        return {node.get_name(): _graph_of(node) for node in nodes}
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=context)


def _graph_of(node: Any) -> dict[str, list[str]]:
    name, space = node.get_name(), node.get_namespace()
    return {
        action: sorted({found for found, _ in getattr(node, query)(name, space)})
        for _, action, _, query in _KINDS
    }


def stated_graph() -> Graph:
    """The same of the policy."""
    graph: Graph = {}
    for enclave in ElementTree.parse(POLICY).getroot().iter("enclave"):
        for profile in enclave.iter("profile"):
            found = graph.setdefault(str(profile.get("node")), {})
            for group, action, item, _ in _KINDS:
                found[action] = sorted(
                    str(entry.text) for part in profile.iter(group)
                    if part.get(action) == "ALLOW" for entry in part.iter(item)
                )  # fmt: skip
    return graph


def written(graph: Graph) -> str:
    """The policy of a graph: one enclave a node, no wildcard."""
    root = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(root, "enclaves")
    for node, parts in graph.items():
        enclave = ElementTree.SubElement(enclaves, "enclave", path=f"/{node}")
        profiles = ElementTree.SubElement(enclave, "profiles")
        profile = ElementTree.SubElement(profiles, "profile", ns="/", node=node)
        for group, action, item, _ in _KINDS:
            if parts[action]:
                part = ElementTree.SubElement(profile, group, {action: "ALLOW"})
                for name in parts[action]:
                    ElementTree.SubElement(part, item).text = name
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def differences(running: Graph, stated: Graph) -> list[str]:
    """What runs and is not allowed, and what is allowed and does not run."""
    found = []
    for node in sorted({*running, *stated}):
        for _, action, _, _ in _KINDS:
            here = {*running.get(node, {}).get(action, [])}
            there = {*stated.get(node, {}).get(action, [])}
            found += [f"{node}: {action} {name} is not in the policy" for name in here - there]
            found += [f"{node}: {action} {name} is only in the policy" for name in there - here]
    return sorted(found)


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the policy")
    graph = running_graph()
    if parser.parse_args().write:
        POLICY.parent.mkdir(exist_ok=True)
        POLICY.write_text(written(graph), encoding="utf-8")
    found = differences(graph, stated_graph())
    print("\n".join(found) or "the policy is the graph of the running nodes")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
