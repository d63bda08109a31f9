"""The demonstration: a published manoeuvre, planned, checked and streamed by the real node.

The node runs as a process of its own; this one only listens to its topics, as any controller
would, and judges what it hears by its own certificate.
"""

from __future__ import annotations

import argparse
import math
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from tqdm import tqdm

from riem_planner.certificate import certify
from riem_planner.geometry import so3
from riem_planner.node.planning import Goal, build_problem
from riem_planner.node.settings import Settings, default_values, settings_from_values
from riem_planner.node.timeline import Setpoint
from riem_planner.node.world import World
from riem_planner.offline.straight import straight_slew
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

PATIENCE = 900.0
"""How long the first plan may take: the very first start compiles the solver [s]."""


def configuration(name: str = "demo.yaml") -> Path:
    """A configuration file: beside the sources, else where the package was installed."""
    beside = Path(__file__).resolve().parents[2] / "config" / name
    if beside.is_file():
        return beside
    from ament_index_python.packages import get_package_share_directory

    return Path(get_package_share_directory("riem_planner")) / "config" / name


def flattened(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Parameter values by full name, from nested maps."""
    values: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            values.update(flattened(value, f"{prefix}{key}."))
        else:
            values[f"{prefix}{key}"] = value
    return values


def settings_of(path: Path) -> Settings:
    """Settings that the node takes from a parameter file."""
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    given = flattened(tree["/riem_planner"]["ros__parameters"])
    return settings_from_values({**default_values(tuple(given.get("zone_names", []))), **given})


def problem_of(settings: Settings) -> Problem:
    """The problem that the node is set at its start."""
    goal = settings.goal_orientation
    assert goal is not None  # the demonstration has one
    rest = np.zeros(3)
    start = Setpoint(0, settings.start_orientation, rest, rest)
    return build_problem(settings, World(settings), start, Goal(goal, rest), settings.duration)


class Listener:
    """Hears the node's topics, in a thread of its own."""

    def __init__(self) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticStatus
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from rclpy.signals import SignalHandlerOptions
        from trajectory_msgs.msg import MultiDOFJointTrajectory

        self.reference: MultiDOFJointTrajectory | None = None
        self.status: DiagnosticStatus | None = None
        self.setpoint_ns = 0
        self.setpoints = 0
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("riem_planner_demo")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listen = self._node.create_subscription
        listen(MultiDOFJointTrajectory, "/riem_planner/reference", self._hear_reference, latched)
        listen(DiagnosticStatus, "/riem_planner/status", self._hear_status, latched)
        listen(MultiDOFJointTrajectory, "/riem_planner/setpoint", self._hear_setpoint, 1)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        import rclpy
        from rclpy.executors import ExternalShutdownException

        try:
            while rclpy.ok():
                self._executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return

    def _hear_reference(self, message: Any) -> None:
        self.reference = message

    def _hear_status(self, message: Any) -> None:
        # What is told later must not hide the figures of the plan.
        if self.status is None or not any(item.key == "cost" for item in self.status.values):
            self.status = message

    def _hear_setpoint(self, message: Any) -> None:
        stamp = message.header.stamp
        self.setpoint_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
        self.setpoints += 1

    def close(self) -> None:
        """End the thread, then the node."""
        import rclpy

        rclpy.try_shutdown()
        self._thread.join(1.0)
        self._node.destroy_node()


def report(problem: Problem, trajectory: Trajectory, status: Any) -> str:
    """What was planned, beside what the straight slew would have done."""
    from msg_adapters.status import report_from_status

    straight = certify(straight_slew(problem), problem).clearance
    certificate = certify(trajectory, problem)
    _, _, values = report_from_status(status)
    angle = math.degrees(float(so3.distance(problem.start.orientation, problem.goal.orientation)))
    rows = [
        f"a turn by {angle:.1f} deg in {trajectory.duration:g} s, cost"
        f" {values.get('cost', '?')} rad^2/s^3, solved in {values.get('solve_time_ms', '?')} ms",
        f"{'':24}{'planned':>12}{'straight slew':>16}   clearance",
    ]
    for name, clearance in certificate.clearance.items():
        beside = math.degrees(straight[name])
        rows.append(f"{name:24}{math.degrees(clearance):8.2f} deg{beside:12.2f} deg")
    verdict = "certified" if certificate.certified else "; ".join(certificate.reasons)
    rows.append(f"checked here, from the messages: {verdict}")
    return "\n".join(rows)


def _wait_for_plan(
    listener: Listener, node: subprocess.Popen[bytes], stop: threading.Event
) -> bool:
    begin = time.monotonic()
    while not stop.wait(0.05):
        if listener.reference is not None and listener.status is not None:
            return True
        if node.poll() is not None or time.monotonic() - begin > PATIENCE:
            return False
    return False


def _follow(
    listener: Listener, start_ns: int, duration: float, stop: threading.Event, quiet: bool
) -> None:
    bar = tqdm(total=round(duration, 1), unit="s", desc="streaming", disable=quiet,
               bar_format="{desc} {percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s{postfix}")
    while not stop.wait(0.1):
        done = min(max((listener.setpoint_ns - start_ns) * 1e-9, 0.0), duration)
        bar.n = round(done, 1)
        bar.set_postfix_str(f"{listener.setpoints} setpoints")
        if done >= duration:
            break
    bar.close()


def _end(node: subprocess.Popen[bytes]) -> int:
    if node.poll() is None:
        node.send_signal(signal.SIGINT)
    try:
        return node.wait(5.0)
    except subprocess.TimeoutExpired:
        node.kill()
        return 1


def main(arguments: list[str] | None = None) -> int:
    """Run the demonstration; returns the exit code."""
    parser = argparse.ArgumentParser(prog="make run", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="parameter file of the node")
    parser.add_argument("--picture", type=Path, default=Path("demo.png"), help="what to write")
    parser.add_argument("--duration", type=float, default=None, help="of the slew [s]")
    options = parser.parse_args(arguments)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    path = options.config or configuration()
    settings = settings_of(path)
    command = [sys.executable, "-m", "riem_planner.node.main", "--ros-args",
               "--params-file", str(path)]
    if options.duration is not None:
        command += ["-p", f"duration:={options.duration}"]
    node = subprocess.Popen(command)
    listener = Listener()
    try:
        return _show(settings, options.picture, listener, node, stop)
    finally:
        listener.close()
        _end(node)


def _show(
    settings: Settings,
    picture: Path,
    listener: Listener,
    node: subprocess.Popen[bytes],
    stop: threading.Event,
) -> int:
    from msg_adapters.trajectory import samples_from_reference

    if not _wait_for_plan(listener, node, stop):
        if stop.is_set():
            return 0
        why = "the node ended" if node.poll() is not None else "no plan came"
        if listener.status is not None:
            why += f": {listener.status.message}"
        print(why, file=sys.stderr)
        return 1
    assert listener.reference is not None  # a plan came
    samples, start_ns = samples_from_reference(listener.reference)
    times, quaternions, rates, accelerations = samples
    trajectory = Trajectory(times, quaternions, rates, accelerations)
    problem = problem_of(replace(settings, duration=trajectory.duration))
    print(report(problem, trajectory, listener.status))
    _draw(problem, trajectory, picture)
    _follow(listener, start_ns, trajectory.duration, stop, quiet=False)
    if node.poll() is not None and not stop.is_set():
        print("the node ended before the slew did", file=sys.stderr)
        return 1
    ending = "stopped before the end" if stop.is_set() else "the end is held"
    print(f"{listener.setpoints} setpoints; {ending}; picture: {picture}")
    return 0


def _draw(problem: Problem, trajectory: Trajectory, picture: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from riem_planner.offline.plots import plot_plan

    plot_plan(problem, trajectory, picture)


if __name__ == "__main__":
    sys.exit(main())
