# SPDX-License-Identifier: Apache-2.0
"""Who is heard: every sender, reliable or best effort, volatile or latched, and each message once.

No subscription hears them all. A best effort, volatile one hears every sender, but not what was
sent before it was there, and it may lose a packet; a reliable, volatile one loses nothing of
reliable senders; a latched one hears what latched senders told before. So a topic has up to three
of them, and a message may come as often; `Heard` tells copies, and what comes too late, by the
time at which it was sent, which is the same in all copies.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import deserialize_message

REMEMBERED = 4096
"""Messages of a topic whose copies are known."""
DISORDER_NS = 2_000_000_000
"""What was sent up to that much earlier, and comes by another way, was overtaken on it [ns]."""

INPUT_POLICIES = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)


class Way(Enum):
    """A subscription of a topic."""

    BEST_EFFORT = (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
    RELIABLE = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    LATCHED = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)


class Use(Enum):
    """What to do about a message."""

    NEW = "use it"
    COPY = "it has come before"
    LATE = "what was sent later has come before"


class Heard:
    """Which messages of a topic have come."""

    def __init__(self) -> None:
        self._known: set[int] = set()
        self._order: deque[int] = deque()
        self._newest = 0
        self._last: tuple[int, Way] | None = None

    def use(self, sent_ns: int, way: Way) -> Use:
        """What to do about a message that was sent at a time [ns] and comes by a way.

        Order is held within a subscription, and nothing promises it between two. What the
        latched one brings never replaces anything that was sent later.
        """
        if sent_ns <= 0:
            return Use.NEW  # this middleware does not tell
        if sent_ns in self._known:
            return Use.COPY
        self._known.add(sent_ns)
        self._order.append(sent_ns)
        if len(self._order) > REMEMBERED:
            self._known.discard(self._order.popleft())
        if way is Way.LATCHED and sent_ns < self._newest:
            return Use.LATE
        if self._last is not None and self._last[1] is not way:
            behind = self._last[0] - sent_ns
            if 0 < behind < DISORDER_NS:
                return Use.LATE
        self._newest = max(self._newest, sent_ns)
        self._last = (sent_ns, way)
        return Use.NEW


def overriding(policies: tuple[QoSPolicyKind, ...] = INPUT_POLICIES) -> QoSOverridingOptions:
    """QoS parameters of a topic that users may set."""
    return QoSOverridingOptions(policy_kinds=policies)


class Ear:
    """The subscriptions of one topic.

    Parameters
    ----------
    node
        Whose they are.
    topic, kind
        Of the messages.
    receive
        Called with each message once, and whether one that was sent later has come before it.
    depth
        Messages that may wait.
    streams
        Whether it is told many times a second: then a lost message is soon made up for, and the
        reliable subscription is left out unless its QoS is set.
    raw
        Whether messages are handed on as they travel.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        kind: type,
        receive: Callable[[Any, bool], None],
        *,
        depth: int = 1,
        streams: bool = False,
        raw: bool = False,
    ) -> None:
        self._node, self._kind, self._receive = node, kind, receive
        self._depth, self._raw = depth, raw
        self._heard = Heard()
        self._topic = topic
        self._resolved = node.resolve_topic_name(topic)
        self._latched = False
        prefix = f"qos_overrides.{self._resolved}."
        told = any(name.startswith(prefix) for name in getattr(node, "_parameter_overrides", {}))
        if told or not streams:
            # First, so that a sender who sees a subscription sees this one, and is not lost.
            self._subscribe(Way.RELIABLE)
        self._subscribe(Way.BEST_EFFORT)

    def _subscribe(self, way: Way) -> None:
        def receive(data: bytes, info: dict[str, int]) -> None:
            use = self._heard.use(int(info.get("source_timestamp", 0)), way)
            if use is not Use.COPY:
                message = data if self._raw else deserialize_message(data, self._kind)
                self._receive(message, use is Use.LATE)

        reliability, durability = way.value
        options = {"qos_overriding_options": overriding()} if way is Way.RELIABLE else {}
        self._node.create_subscription(
            self._kind,
            self._topic,
            receive,
            QoSProfile(depth=self._depth, reliability=reliability, durability=durability),
            raw=True,
            # What one of them does not hear another does.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            **options,
        )

    def look(self) -> None:
        """Listen to what latched senders told before, as soon as there is one."""
        if self._latched:
            return
        for sender in self._node.get_publishers_info_by_topic(self._resolved):
            profile = sender.qos_profile
            if (profile.reliability, profile.durability) == Way.LATCHED.value:
                self._latched = True
                self._subscribe(Way.LATCHED)
                return
