# SPDX-License-Identifier: Apache-2.0
"""Messages to a simulated mission, through the very checks that the node's inputs make."""

from contextlib import contextmanager

from rclpy.serialization import serialize_message

from riem_planner.node.inputs import Desk, Inputs


class Inbox:
    """Stands in for the node about its `Inputs`."""

    def __init__(self, simulation):
        self._simulation = simulation
        self.rejected = []
        self._warnings = []
        desk = Desk(
            lambda: simulation.mission.settings,
            lambda: simulation.mission,
            self._calls,
            lambda topic, error, stamp_ns: self.rejected.append((topic, str(error))),
            lambda topic, sentence: self._warnings.append((topic, sentence)),
        )
        self._inputs = Inputs(desk)
        self._sources = {source.topic: source for source in self._inputs.topics}

    @contextmanager
    def _calls(self):
        yield self._simulation.now_ns

    def send(self, name, message):
        """Give a message to the input it is for."""
        source = self._sources[f"~/{name}"]
        message = serialize_message(message) if source.raw else message
        self._inputs.receive(source, message, False)
