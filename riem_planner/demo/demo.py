# SPDX-License-Identifier: Apache-2.0
"""The demonstration: a published manoeuvre, planned and streamed by the real node, and flown.

The node and the simulated spacecraft run as processes of their own; this one only listens to
their topics, judges the plan by its own certificate, and what is flown by the zones.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from tqdm import tqdm

from riem_planner.mission.planning import Goal, build_problem
from riem_planner.mission.settings import Settings, default_values, settings_from_values
from riem_planner.mission.timeline import Setpoint
from riem_planner.mission.zone_tracker import World
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

if TYPE_CHECKING:
    from riem_planner.demo.listener import Listener

PATIENCE = 900.0
"""How long the first plan may take: the very first start compiles the solver [s]."""
DISCOVERY = 10.0
"""How long the spacecraft may take to be heard [s]."""
REFUSAL = 3.0
"""How long a refusal must stand before it is taken for the answer: the node tries again [s]."""


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
    given = flattened(tree["/**"]["ros__parameters"])
    return settings_from_values({**default_values(tuple(given.get("zone_names", []))), **given})


def problem_of(settings: Settings) -> Problem:
    """The problem that the node is set at its start."""
    goal = settings.goal_orientation
    assert goal is not None  # the demonstration has one
    rest = np.zeros(3)
    start = Setpoint(0, settings.start_orientation, rest, rest)
    return build_problem(settings, World(settings), start, Goal(goal, rest), settings.duration)


@dataclass
class Demonstration:
    """The show: what runs, who listens, and what ends it early."""

    settings: Settings
    picture: Path
    listener: Listener
    planner: subprocess.Popen[bytes]
    spacecraft: subprocess.Popen[bytes]
    stop: threading.Event
    flies: bool = True

    def run(self) -> int:
        """Wait for the plan, show it, follow it, and say how it was flown; the exit code."""
        from msg_adapters.status import report_from_status
        from msg_adapters.trajectory import samples_from_reference
        from riem_planner.demo.report import clearance_table, headline

        listener = self.listener
        if not self._wait_for_plan():
            return 0 if self.stop.is_set() else self._without_plan()
        assert listener.reference is not None  # a plan came
        assert listener.status is not None
        samples, start_ns = samples_from_reference(listener.reference)
        trajectory = Trajectory(*samples)
        problem = problem_of(replace(self.settings, duration=trajectory.duration))
        print(headline(problem, trajectory, report_from_status(listener.status)[2]))
        _draw(problem, trajectory, self.picture)
        self._follow(start_ns, trajectory.duration)
        flown = listener.flown(start_ns, trajectory.duration) if self._spacecraft_lives() else None
        print(clearance_table(problem, trajectory, flown))
        if self.planner.poll() is not None and not self.stop.is_set():
            print("the node ended before the slew did", file=sys.stderr)
            return 1
        ending = "stopped before the end" if self.stop.is_set() else "the end is held"
        print(
            f"{listener.setpoints} setpoints; {ending}; picture: {self.picture},"
            f" page: {self.picture.with_suffix('.html')}"
        )
        return 0

    def _wait_for_plan(self) -> bool:
        begin = refused = time.monotonic()
        while not self.stop.wait(0.05):
            now = time.monotonic()
            if self.listener.reference is not None and self.listener.status is not None:
                return True
            if not self.listener.is_refused:
                refused = now
            if self.planner.poll() is not None or now - begin > PATIENCE or now - refused > REFUSAL:
                return False
            if not self._spacecraft_lives():  # the node waits for a state
                self.listener.tell_state(self.settings.start_orientation)
        return False

    def _without_plan(self) -> int:
        why = "the node ended" if self.planner.poll() is not None else "no plan came"
        if self.listener.status is not None:
            why += f": {self.listener.status.message}"
        print(why, file=sys.stderr)
        return 1

    def _follow(self, start_ns: int, duration: float) -> None:
        bar = tqdm(
            total=round(duration, 1),
            unit="s",
            desc="flying",
            bar_format="{desc} {percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s{postfix}",
        )
        while not self.stop.wait(0.1):
            done = min(max((self.listener.setpoint_ns - start_ns) * 1e-9, 0.0), duration)
            bar.n = round(done, 1)
            bar.set_postfix_str(f"{self.listener.setpoints} setpoints")
            self._spacecraft_lives()
            if done >= duration or self.planner.poll() is not None:
                break
        bar.close()

    def _spacecraft_lives(self) -> bool:
        """Whether the simulator runs; says once that it does not."""
        if self.flies and not self.stop.is_set() and self.spacecraft.poll() is not None:
            self.flies = False
            tqdm.write("the simulated spacecraft ended; going on without", file=sys.stderr)
        return self.flies


def _end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in processes:
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            print(f"process {process.pid} ({process.args!r}) did not end; killed", file=sys.stderr)
            process.kill()
            process.wait()


def _commands(settings: Settings, path: Path, duration: float | None) -> tuple[list[str], ...]:
    """Of the planner, which plans as soon as it knows where the spacecraft is, and of that."""
    start = [float(number) for number in settings.start_orientation]
    values = (
        ["require_state:=true"] + ([] if duration is None else [f"duration:={duration}"]),
        [f"start.orientation:={start}"],
    )
    modules = "riem_planner.node.main", "riem_planner.spacecraft_sim.main"
    return tuple(
        [sys.executable, "-m", module, "--ros-args", "--params-file", str(path)]
        + [word for value in given for word in ("-p", value)]
        for module, given in zip(modules, values, strict=True)
    )


def main(arguments: list[str] | None = None) -> int:
    """Run the demonstration; returns the exit code."""
    parser = argparse.ArgumentParser(prog="make run", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="parameter file of the nodes")
    parser.add_argument("--picture", type=Path, default=Path("demo.png"), help="what to write")
    parser.add_argument("--duration", type=float, default=None, help="of the slew [s]")
    options = parser.parse_args(arguments)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    path = options.config or configuration()
    settings = settings_of(path)

    # Here, so that a signal during the second that this takes is answered as well.
    from riem_planner.demo.listener import Listener

    listener = Listener((settings.reference_frame, settings.body_frame))
    plans, flies = _commands(settings, path, options.duration)
    spacecraft = subprocess.Popen(flies)
    processes = [spacecraft]
    try:
        _wait_for_state(listener, spacecraft, stop)
        planner = subprocess.Popen(plans)
        processes.insert(0, planner)
        show = Demonstration(settings, options.picture, listener, planner, spacecraft, stop)
        return show.run()
    finally:
        _end(processes)
        listener.close()


def _wait_for_state(
    listener: Listener, spacecraft: subprocess.Popen[bytes], stop: threading.Event
) -> None:
    """Wait until the spacecraft is heard: to find each other may take processes seconds."""
    end = time.monotonic() + DISCOVERY
    while not (listener.hears_state or spacecraft.poll() is not None or stop.wait(0.02)):
        if time.monotonic() > end:
            return


def _draw(problem: Problem, trajectory: Trajectory, picture: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from riem_planner.certificate import certify
    from riem_planner.page import plan_page
    from riem_planner.plots.plots import plot_plan
    from riem_planner.solution import Solution, Status
    from riem_planner.version import __version__

    plot_plan(problem, trajectory, picture)
    certificate = certify(trajectory, problem)
    message = "; ".join(certificate.reasons) or "the plan that the node published, judged here"
    solution = Solution(Status.SOLVED, message, trajectory, certificate)
    page = plan_page(problem, solution, trajectory, certificate, version=__version__)
    picture.with_suffix(".html").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
