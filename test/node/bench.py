# SPDX-License-Identifier: Apache-2.0
"""A planner node and a client node in one process, each with all topics at hand."""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped, QuaternionStamped, Vector3Stamped
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu
from simulation import discontinuities
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from msg_adapters import geometry
from msg_adapters.trajectory import samples_from_reference
from riem_planner.mission.timeline import Setpoint
from riem_planner.node.planner_node import PlannerNode

FRAME, BODY = "inertial", "base_link"
OUTPUTS = {
    "trajectory": (PoseArray, True),
    "reference": (MultiDOFJointTrajectory, True),
    "markers": (MarkerArray, True),
    "status": (DiagnosticStatus, True),
    "setpoint": (MultiDOFJointTrajectory, False),
    "attitude_setpoint": (QuaternionStamped, False),
}
INPUTS = {
    "goal": PoseStamped,
    "goal_state": Odometry,
    "state": Odometry,
    "imu": Imu,
    "obstacles": PoseArray,
}
SERVICES = {
    "replan": Trigger,
    "cancel": Trigger,
    "execute": Trigger,
    "change_state": ChangeState,
    "get_state": GetState,
    "describe_parameters": DescribeParameters,
    "set_parameters": SetParameters,
    "set_parameters_atomically": SetParametersAtomically,
}


class Bench:
    """Node under test and client, each with its executor, in a context of their own."""

    def __init__(self, zones, values, before=None):
        self.context = Context()
        rclpy.init(context=self.context)
        overrides = [Parameter("zone_names", value=list(zones))] if zones else []
        for name, value in {"duration": 4.0, **values}.items():
            zone, _, key = name.partition("__")
            full = f"zones.{zone}.{key}" if key else name.replace("_DOT_", ".")
            overrides.append(Parameter(full, value=value))
        self.client = Node("client", context=self.context)
        if before is not None:
            before(self)
        self.node = PlannerNode(context=self.context, parameter_overrides=overrides)
        self.heard = {name: [] for name in [*OUTPUTS, "diagnostics"]}
        for name, (kind, latched) in OUTPUTS.items():
            self._listen(kind, f"/riem_planner/{name}", name, latched)
        self._listen(DiagnosticArray, "/diagnostics", "diagnostics", False)
        kinds = {**INPUTS, **{f"zones/{zone}": Vector3Stamped for zone in zones}}
        self.publishers = {
            name: self.client.create_publisher(kind, f"/riem_planner/{name}", 1)
            for name, kind in kinds.items()
        }
        self.clients = {
            name: self.client.create_client(kind, f"/riem_planner/{name}")
            for name, kind in SERVICES.items()
        }
        self.closing = False
        self.failure = None
        self.executors = [
            SingleThreadedExecutor(context=self.context),
            SingleThreadedExecutor(context=self.context),
        ]
        self.threads = []
        for executor, node in zip(self.executors, (self.node, self.client), strict=True):
            executor.add_node(node)
            thread = threading.Thread(target=self._spin, args=(executor,), daemon=True)
            thread.start()
            self.threads.append(thread)

    def _spin(self, executor):
        try:
            executor.spin()
        except ExternalShutdownException:
            pass
        except Exception as error:
            if not self.closing:  # an executor may stumble over what is being destroyed
                self.failure = error

    def _listen(self, kind, topic, name, latched):
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=500, durability=durability)
        self.client.create_subscription(kind, topic, self.heard[name].append, qos)

    def state(self):
        """Lifecycle state of the node."""
        return self.node._state_machine.current_state[1]

    def wait(self, condition, seconds=5.0):
        """Wait until something is so; fails if it does not become so."""
        end = time.monotonic() + seconds
        while not condition():
            assert self.failure is None, self.failure
            assert time.monotonic() < end, "waited in vain"
            time.sleep(0.005)

    def send(self, name, message):
        """Publish, once the node listens."""
        publisher = self.publishers[name]
        self.wait(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(message)

    def goal(self, quaternion, stamp_ns=0, frame=FRAME):
        """Send a goal."""
        q = np.asarray(quaternion, dtype=float)
        self.send("goal", geometry.pose_from_attitude(q, stamp_ns, frame))

    def zone(self, name, direction, stamp_ns=0):
        """Send the direction of a zone."""
        d = np.asarray(direction, dtype=float)
        self.send(f"zones/{name}", geometry.vector_from_direction(d, stamp_ns, FRAME))

    def codes(self):
        """Codes of all that came on ~/status."""
        return [item.value for m in self.heard["status"] for item in m.values if item.key == "code"]

    def call(self, kind, name, request=None, seconds=10.0):
        """Call a service of the node."""
        client = self.clients[name]
        assert client.srv_type is kind
        self.wait(client.service_is_ready, 10.0)
        future = client.call_async(request or kind.Request())
        self.wait(future.done, seconds)
        return future.result()

    def trigger(self, name):
        """Call ~/replan, ~/cancel or ~/execute."""
        return self.call(Trigger, name)

    def setpoints(self):
        """All setpoints heard, as the core knows them."""
        found = []
        for message in list(self.heard["setpoint"]):
            samples, stamp_ns = samples_from_reference(message)
            found.append(
                Setpoint(
                    stamp_ns, samples.quaternions[0], samples.rates[0], samples.accelerations[0]
                )
            )
        return found

    def check_continuity(self):
        """No jump in anything that was heard."""
        # Messages carry unit quaternions that the reader normalises once more.
        assert not discontinuities(self.setpoints(), 2e-9)

    def close(self):
        """End everything, in the order that leaves nothing behind."""
        self.closing = True
        for executor in self.executors:
            executor.shutdown(timeout_sec=2.0)
        for thread in self.threads:
            thread.join(2.0)
        self.node.close()
        self.client.destroy_node()
        self.context.try_shutdown()
        # A lifecycle node keeps its services until it is collected, and a half of one that is
        # left in the graph would make the next node's look unavailable.
        self.node = self.client = None
        self.executors.clear()
        self.clients.clear()
        self.publishers.clear()
        gc.collect()
        assert self.failure is None, self.failure
