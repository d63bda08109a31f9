"""Messages to a simulated mission, through the very checks that the node's inputs make."""

from contextlib import contextmanager

from rclpy.serialization import serialize_message

from riem_planner.node.inputs import Inputs


class Inbox:
    """Stands in for the node beneath its `Inputs`."""

    def __init__(self, simulation):
        self._simulation = simulation
        self._receivers = {}
        self.settings = simulation.mission.settings
        self.rejected = []
        self.outputs = self
        Inputs(self)

    @property
    def mission(self):
        """What the inputs call."""
        return self._simulation.mission

    def create_subscription(self, kind, topic, receive, qos, *, raw=False, **options):
        """Keep what a message is given to."""
        self._receivers[topic] = (receive, raw)

    @contextmanager
    def calls(self):
        """The time of a call."""
        yield self._simulation.now_ns

    def reject(self, topic, problem):
        """Note a refusal."""
        self.rejected.append((topic, problem))

    def send(self, name, message):
        """Give a message to the input it is for."""
        receive, raw = self._receivers[f"~/{name}"]
        receive(serialize_message(message) if raw else message)
