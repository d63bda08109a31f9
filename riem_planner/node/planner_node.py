"""The planner as a managed ROS node: messages to calls, results to messages, timers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_srvs.srv import Trigger

from riem_planner.mission.mission import BACKWARD_NS, FORWARD_NS, Mission
from riem_planner.mission.planning import Goal, Result
from riem_planner.mission.settings import Settings
from riem_planner.node.executor import BesideGroup
from riem_planner.node.inputs import Inputs
from riem_planner.node.outputs import Outputs
from riem_planner.node.parameters import Parameters
from riem_planner.node.streamer import Streamer
from riem_planner.node.worker import Worker
from riem_planner.solve import warm_up

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE

TICK = 0.05
"""Time between two looks at what changes with time [s]."""
STANDSTILL = 5.0
"""How long the clock may stand still while a stop is waited for [s]."""


class PlannerNode(LifecycleNode):
    """The node `/riem_planner`.

    Decisions are the mission's; they are made under one lock. The stream of setpoints reads the
    mission's reference, and never waits for that lock.

    Parameters
    ----------
    settle
        Called once the solver is loaded, before anything is streamed.
    options
        Those of a lifecycle node.

    Attributes
    ----------
    mission
        What decides; called with `lock` held.
    outputs
        What publishes.
    streamer
        The thread that calls for each setpoint.
    worker
        What plans.

    Raises
    ------
    InvalidProblemError
        A parameter's override is wrong.
    """

    def __init__(self, *, settle: Callable[[], None] = lambda: None, **options: Any) -> None:
        super().__init__("riem_planner", **options)
        self._settle = settle
        self.lock = threading.RLock()
        self._last_stamp = 0
        self._configured = False
        self._closing = False
        self._declared = Parameters(self, lambda: not self._configured, self._changed)
        self.mission = Mission(self.settings)
        self.worker = Worker(self._deliver, self.fault)
        self.outputs = Outputs(self)
        self._inputs = Inputs(self)
        self._create_services()
        self._guard_transitions()
        self._create_timers()
        self._report_unknown()

    @property
    def settings(self) -> Settings:
        """The parameters, validated."""
        return self._declared.settings

    # Set-up -------------------------------------------------------------------------------------

    def _create_services(self) -> None:
        def trigger(call: Callable[[int], tuple[bool, str]]) -> Callable[[Any, Any], Any]:
            def answer(_: Any, response: Trigger.Response) -> Trigger.Response:
                response.message = "a fault; see the log"
                with self.calls() as now_ns:
                    response.success, response.message = call(now_ns)
                return response

            return answer

        self.create_service(Trigger, "~/replan", trigger(lambda now: self.mission.replan(now)))
        self.create_service(Trigger, "~/cancel", trigger(lambda now: self.mission.cancel(now)))
        self.create_service(Trigger, "~/execute", trigger(lambda now: self.mission.execute(now)))

    def _create_timers(self) -> None:
        self.streamer = Streamer(
            self._stream, lambda: self.settings.period_ns, self._simulated_ns, self.fault
        )
        self.create_timer(TICK, self._tick)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK, self.outputs.catch_up, clock=steady)
        self.create_timer(1.0, self._report_health, clock=steady)
        if self.get_parameter("autostart").value:
            self.create_guard_condition(self._autostart, self._transitions).trigger()

    def _guard_transitions(self) -> None:
        """Answer an invalid transition request with a refusal.

        Left to itself the service lets the error escape from `spin`, which ends the node.
        """
        service = self._service_change_state
        # A transition may wait for a stop, and everything else goes on meanwhile.
        self._transitions = BesideGroup()
        self._transitions.add_entity(service)
        service.callback_group = self._transitions
        change = service.callback

        def guarded(
            request: ChangeState.Request, response: ChangeState.Response
        ) -> ChangeState.Response:
            wanted = request.transition
            for available in self._state_machine.available_transitions:
                if wanted.label == available[1] or (not wanted.label and wanted.id == available[0]):
                    return change(request, response)
            name = wanted.label or str(wanted.id)
            state = self._state_machine.current_state[1]
            self.get_logger().warning(f"transition {name} refused: not possible from {state}")
            response.success = False
            return response

        service.callback = guarded

    def _report_unknown(self) -> None:
        names = self.list_parameters([], 0).names
        for sentence in self._declared.unknown(names):
            self.get_logger().warning(sentence)

    # Lifecycle ----------------------------------------------------------------------------------

    def _autostart(self) -> None:
        if self._state_machine.current_state[1] != "unconfigured":
            return
        if self.trigger_configure() == SUCCESS:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Validate the parameters and warm the kernels."""
        if not self._warm():
            return FAILURE
        with self.lock:
            self.mission = Mission(self.settings)
            self._configured = True
        return super().on_configure(state)

    def _warm(self) -> bool:
        """Load or compile the kernels beside everything else; False if the node is closing."""
        done = threading.Event()
        failures: list[str] = []

        def warm() -> None:
            try:
                warm_up(notify=lambda sentence: self.get_logger().info(sentence))
            except Exception as error:
                failures.append(f"{type(error).__name__}: {error}")
            done.set()

        self.worker.chore("warm up", warm)
        while not done.wait(0.05):
            if self._closing or not self.context.ok():
                return False
        if failures:
            self.get_logger().error(f"the solver can't be loaded: {failures[0]}")
        self._settle()
        return not failures

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to plan and to stream."""
        result = super().on_activate(state)
        self.streamer.start()
        with self.calls() as now_ns:
            self.mission.activate(now_ns)
            if self.settings.goal_orientation is not None:
                goal = Goal(np.array(self.settings.goal_orientation), np.zeros(3))
                self.mission.set_goal(goal, now_ns)
        self.get_logger().info("ready")
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Come to rest along a certified stop, then end the stream."""
        self._come_to_rest()
        self._stop_streaming()
        with self.lock:
            self.mission.deactivate()
            self.outputs.forget()
        self.worker.withdraw()
        return super().on_deactivate(state)

    def _come_to_rest(self) -> None:
        with self.calls() as now_ns:
            self.mission.cancel(now_ns)
        last_ns, since = 0, time.monotonic()
        while self.context.ok() and not self._closing:
            with self.lock:
                now_ns = self.now_ns()
                timeline = self.mission.timeline
            # The last setpoint says that it is at rest, so that a controller knows.
            published = max(self._last_stamp, now_ns - 10 * self.settings.period_ns)
            if not timeline or timeline.resting(min(now_ns, published)):
                return
            if now_ns != last_ns:
                last_ns, since = now_ns, time.monotonic()
            elif time.monotonic() - since > STANDSTILL:
                self.get_logger().warning("the clock stands still: the stream ends without a stop")
                return
            time.sleep(0.02)

    def _stop_streaming(self) -> None:
        self.streamer.stop()
        self.outputs.watch.pause()

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything that came."""
        self._forget()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Come to rest, if it is active, and end."""
        if self.mission.active:
            self._come_to_rest()
        self._stop_streaming()
        self._forget()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """After a fault in a transition: back to unconfigured."""
        self.get_logger().error("a transition failed; the node is unconfigured")
        self._stop_streaming()
        self._forget()
        return SUCCESS

    def _forget(self) -> None:
        with self.lock:
            self.worker.withdraw()
            self.mission = Mission(self.settings)
            self._configured = False

    def close(self) -> bool:
        """End the worker and the node; whether nothing is left that can't be interrupted."""
        self._closing = True
        ended = self.streamer.close(0.3)
        ended = self.worker.close(0.3) and ended
        self.outputs.write_log()
        with suppress(InvalidHandle):  # another thread may be in the middle of a call
            self.destroy_node()
        return ended

    # Calls --------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """The node's clock [ns]."""
        return int(self.get_clock().now().nanoseconds)

    def _simulated_ns(self) -> int | None:
        clock = self.get_clock()
        return int(clock.now().nanoseconds) if clock.ros_time_is_active else None

    @contextmanager
    def calls(self) -> Iterator[int]:
        """Call the mission at the time given, then publish what came of it.

        A fault in a call is told and ends there: what was certified before is streamed on.
        """
        with self.lock:
            try:
                yield self.now_ns()
                self._follow_up()
            except Exception as error:
                self.fault(f"{type(error).__name__}: {error}")

    def _follow_up(self) -> None:
        mission = self.mission
        if mission.pending is None:
            self.worker.withdraw()
        for event in mission.take_events():
            self.outputs.tell(event)
        # Last, since telling beside a solve takes longer than before it.
        request = mission.take_wanted()
        if request is not None:
            self.worker.submit(request)

    def _changed(self, settings: Settings) -> None:
        with self.calls() as now_ns:
            self.mission.configure(settings, now_ns)

    def _deliver(self, result: Result) -> None:
        if not self._closing:
            with self.calls() as now_ns:
                self.mission.accept(result, now_ns)

    def fault(self, sentence: str) -> None:
        """Tell of an error that nothing else has caught."""
        if not self._closing:
            self.get_logger().error(f"fault, the stream goes on: {sentence}")

    def _tick(self) -> None:
        with self.calls() as now_ns:
            self.mission.tick(now_ns)

    def _report_health(self) -> None:
        with self.lock:
            self.outputs.report_health(self.mission, self.now_ns())

    # The stream ---------------------------------------------------------------------------------

    def _stream(self) -> None:
        now_ns = self.now_ns()
        step = now_ns - self._last_stamp
        if not -BACKWARD_NS <= step <= FORWARD_NS:
            with self.calls() as now_ns:
                self.mission.advance(now_ns)
        elif step <= 0:
            return
        setpoint = self.mission.reference.stream(now_ns)
        if setpoint is None:
            return
        self._last_stamp = now_ns
        self.outputs.stream(setpoint)
