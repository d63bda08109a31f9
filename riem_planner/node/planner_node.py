# SPDX-License-Identifier: Apache-2.0
"""The planner as a managed ROS node: messages to calls, results to messages, timers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from msg_adapters import MessageError
from riem_planner.errors import InvalidProblemError
from riem_planner.mission.codes import Code
from riem_planner.mission.events import Event
from riem_planner.mission.mission import BACKWARD_NS, FORWARD_NS, Mission
from riem_planner.mission.planning import Goal, Result
from riem_planner.mission.settings import Settings
from riem_planner.node import inputs, outputs, reports
from riem_planner.node.compilation import compile_beside
from riem_planner.node.hearing import Ear
from riem_planner.node.overrides import inapplicable
from riem_planner.node.parameters import Parameters
from riem_planner.node.streamer import Streamer
from riem_planner.node.transitions import Transitions
from riem_planner.node.worker import Worker
from riem_planner.solve import warm_up

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE

TICK = 0.05
"""Time between two looks at what changes with time [s]."""
LOOK = 0.25
"""Time between two looks for latched senders [s]."""
STANDSTILL = 5.0
"""How long the clock may stand still while a stop is waited for [s]."""
CLOCK_PATIENCE = 2.0
"""How long a simulated clock may be silent before it is said so [s]."""
ENDS = 1000
"""Goals whose ends are remembered."""
CLOSE_WITHIN = 0.3
"""Time given to each thread to end [s]."""


class PlannerNode(LifecycleNode):
    """The planner as a node, for any executor of rclpy.

    Decisions are the mission's; they are made under one lock. The stream of setpoints reads the
    mission's reference, and never waits for that lock. Transitions, plans and the stream have
    threads of their own: no callback holds the executor.

    Parameters
    ----------
    node_name
        Its name, if no remapping gives it another.
    settle
        Called once the solver is loaded, before anything is streamed.
    arguments
        Those that rclpy was initialised with; None: those of the process.
    strict
        For a process that is this node's alone: whether to raise where parameter files were given
        that are not for this node.
    options
        Those of a lifecycle node: `namespace`, `parameter_overrides`, `context`, `cli_args` ...

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
        A parameter's override is wrong, or no parameter file that was given is for this node.
    """

    def __init__(
        self,
        node_name: str = "riem_planner",
        *,
        settle: Callable[[], None] = lambda: None,
        strict: bool = False,
        arguments: Sequence[str] | None = None,
        **options: Any,
    ) -> None:
        self.lock = threading.RLock()
        self._closing = False
        self._settle = settle
        self._last_stamp = self._spinning = 0
        self._configured = False
        self._activated = threading.Event()
        self._ends: dict[int, Code] = {}
        self._ended = threading.Condition()
        self._threads: list[Callable[[float], bool]] = []
        if not strict:
            # rclpy leaves that service in the graph when the node is destroyed.
            types = Parameter("start_type_description_service", value=False)
            options["parameter_overrides"] = [types, *(options.get("parameter_overrides") or [])]
        super().__init__(node_name, **options)
        try:
            own = options.get("cli_args")
            if own or options.get("use_global_arguments", True):
                self._check_files(own or arguments, strict)
            self._set_up()
        except BaseException:
            self.destroy_node()
            raise

    def _check_files(self, arguments: Sequence[str] | None, strict: bool) -> None:
        sentence = inapplicable(arguments, self.get_fully_qualified_name())
        if sentence and strict:
            raise InvalidProblemError("--params-file", sentence)
        if sentence:
            self.get_logger().warning(sentence)

    def _set_up(self) -> None:
        self._declared = Parameters(self, lambda: not self._configured, self._changed)
        self.mission = Mission(self.settings)
        self.worker = Worker(self._deliver, self.fault)
        self._threads.append(self.worker.close)
        self.outputs = outputs.Outputs(
            self,
            outputs.Desk(
                self.get_fully_qualified_name(),
                lambda: self.get_logger(),
                lambda: self.settings,
                self.lock,
                self.worker.chore,
            ),
        )
        self._create_services()
        self._create_transitions()
        self.streamer = Streamer(
            self._stream, lambda: self.settings.period_ns, self._simulated_ns, self.fault
        )
        self._threads.append(self.streamer.close)
        self._listen()
        self._create_timers()
        self._report_unknown()

    @property
    def settings(self) -> Settings:
        """The parameters, validated."""
        return self._declared.settings

    @property
    def active(self) -> bool:
        """Whether it plans and streams."""
        return self._activated.is_set()

    def wait_until_active(self, timeout_sec: float | None = None) -> bool:
        """Wait until it plans and streams; call it in another thread than the executor's.

        Parameters
        ----------
        timeout_sec
            How long to wait [s]; None: as long as it takes.

        Returns
        -------
        bool
            Whether it is active; False if it is not yet.
        """
        return self._activated.wait(timeout_sec)

    def wait_for_end(self, stamp_ns: int, timeout_sec: float | None = None) -> Code | None:
        """Wait for the end of a goal; call it in another thread than the executor's.

        Parameters
        ----------
        stamp_ns
            Of the goal's message [ns].
        timeout_sec
            How long to wait [s]; None: as long as it takes.

        Returns
        -------
        Code
            `ARRIVED`, `REPLACED`, `CANCELLED` or `REFUSED`; None if there has been no end yet.
        """
        with self._ended:
            self._ended.wait_for(lambda: stamp_ns in self._ends, timeout_sec)
            return self._ends.get(stamp_ns)

    def _note_ends(self, events: list[Event]) -> None:
        with self._ended:
            for event in events:
                if event.code.ends and event.goal is not None:
                    self._ends[event.goal.stamp_ns] = event.code
            while len(self._ends) > ENDS:
                self._ends.pop(next(iter(self._ends)))
            self._ended.notify_all()

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

    def _listen(self) -> None:
        desk = inputs.Desk(
            lambda: self.settings, lambda: self.mission, self.calls, self._reject, self._warn
        )
        heard = inputs.Inputs(desk)

        def receiver(source: inputs.Input) -> Callable[[Any, bool], None]:
            return lambda message, late: heard.receive(source, message, late)

        self._ears = [
            Ear(
                self,
                source.topic,
                source.kind,
                receiver(source),
                depth=source.depth,
                streams=source.streams,
                raw=source.raw,
            )
            for source in heard.topics
        ]

    def _create_timers(self) -> None:
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._born = time.monotonic()
        self.create_timer(TICK, self._tick, clock=steady)
        self.create_timer(LOOK, self._look, clock=steady)
        self.create_timer(1.0, self._report_health, clock=steady)
        if self.get_parameter("autostart").value:
            # Once it is spun, so that what is done before that comes first.
            start = self.create_guard_condition(lambda: self._transitions.do(self._autostart))
            start.trigger()

    def _create_transitions(self) -> None:
        """Carry transitions out beside the executor, and refuse the invalid ones.

        Left to itself rclpy lets the error of an invalid one escape from `spin`.
        """

        def is_possible(request: ChangeState.Request) -> bool:
            wanted = request.transition
            for available in self._state_machine.available_transitions:
                if wanted.label == available[1] or (not wanted.label and wanted.id == available[0]):
                    return True
            name = wanted.label or str(wanted.id)
            state = self._state_machine.current_state[1]
            self.get_logger().warning(f"transition {name} refused: not possible from {state}")
            return False

        self._transitions = Transitions(self._service_change_state, is_possible, self.fault)
        self._threads.append(self._transitions.close)

    def _report_unknown(self) -> None:
        names = self.list_parameters([], 0).names
        for sentence in self._declared.unknown(names):
            self.get_logger().warning(sentence)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters together; one that is set to the value it has is no change."""
        changes = [each for each in parameter_list if not self._declared.is_set_to(each)]
        if parameter_list and not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    # Lifecycle ----------------------------------------------------------------------------------

    def _autostart(self) -> None:
        if self._state_machine.current_state[1] != "unconfigured":
            return
        if self.trigger_configure() == SUCCESS:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the parameters as they are, and warm the kernels; what came before is kept."""
        self._configured = True
        if not self._warm():
            self._configured = False
            return FAILURE
        return super().on_configure(state)

    def _warm(self) -> bool:
        """Load or compile the kernels beside everything else; False if the node is closing."""
        done = threading.Event()
        failures: list[str] = []

        def warm() -> None:
            def notify(sentence: str) -> None:
                if not self._closing:
                    self.get_logger().info(sentence)

            try:
                compile_beside(notify, lambda: self._closing)
                if not self._closing:
                    warm_up(notify)
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
            wanted = self.settings.goal_orientation
            told = self.mission.goal is not None
            self.mission.activate(now_ns)
            if wanted is not None and not told:
                goal = Goal(np.array(wanted), np.zeros(3), now_ns, "goal.orientation")
                self.mission.set_goal(goal, now_ns)
        sentence = reports.readiness(self.settings)
        log = self.get_logger()
        log.info(sentence) if self.settings.zones else log.warning(sentence)
        self._activated.set()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Come to rest along a certified stop, then end the stream."""
        if not self.come_to_rest():
            return FAILURE
        self._end_work()
        return super().on_deactivate(state)

    def come_to_rest(self, within: float | None = None) -> bool:
        """Fly a certified stop and wait for its end, in another thread than the executor's.

        Parameters
        ----------
        within
            How long it may take [s]; None: as long as it takes.

        Returns
        -------
        bool
            False if nothing can be waited for here, in the executor's own thread.
        """
        with self.calls() as now_ns:
            self.mission.end(now_ns, within)
        last_ns, begin = 0, time.monotonic()
        since = begin
        while self.context.ok() and not self._closing:
            with self.lock:
                now_ns = self.now_ns()
                timeline = self.mission.timeline
            # The last setpoint says that it is at rest, so that a controller knows.
            published = max(self._last_stamp, now_ns - 10 * self.settings.period_ns)
            if not timeline or timeline.resting(min(now_ns, published)):
                return True
            if threading.get_ident() == self._spinning:
                self.get_logger().warning("a stop is flown; deactivate it once it is at rest")
                return False
            if within is not None and time.monotonic() - begin > within:
                return True
            if now_ns != last_ns:
                last_ns, since = now_ns, time.monotonic()
            elif time.monotonic() - since > STANDSTILL:
                self.get_logger().warning("the clock stands still: the stream ends without a stop")
                return True
            time.sleep(0.02)
        return True

    def streamed_rate(self) -> float:
        """The body rate of the last setpoint [rad/s]; 0 where nothing is streamed."""
        setpoint = self.mission.timeline.at(self._last_stamp)
        return 0.0 if setpoint is None else float(np.linalg.norm(setpoint.rate))

    def _end_work(self) -> None:
        """End the stream and forget what was to be done; what was told of the world stays."""
        self._activated.clear()
        self.streamer.stop()
        self.outputs.watch.pause()
        with self.calls():
            self.mission.deactivate()
            self.outputs.forget()
        self.worker.withdraw()

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything that came."""
        self._forget()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Come to rest, if it is active, and end."""
        if self.mission.active:
            self.come_to_rest()
        self._end_work()
        self._forget()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """After a fault in a transition: back to unconfigured."""
        self.get_logger().error("a transition failed; the node is unconfigured")
        self._end_work()
        self._forget()
        return SUCCESS

    def _forget(self) -> None:
        with self.lock:
            self.worker.withdraw()
            self.mission = Mission(self.settings, keeps_goals=False)
            self._configured = False

    def destroy_node(self) -> None:
        """End stream, plans and threads, and leave the graph; a second call does nothing."""
        self.close()

    def close(self) -> bool:
        """End as `destroy_node` does; whether every thread has ended by now."""
        with self.lock:
            if self._closing:
                return True
            self._closing = True
        self._activated.clear()
        ended = [end(CLOSE_WITHIN) for end in self._threads]
        if self.executor is not None:
            self.executor.remove_node(self)
        with suppress(InvalidHandle):  # another thread may be in the middle of a call
            super().destroy_node()
        # Its state machine would keep it in the graph.
        self._state_machine: Any = None
        return all(ended)

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
        events = mission.take_events()
        for event in events:
            self.outputs.tell(event)
        if events:
            self._note_ends(events)
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

    def _reject(self, topic: str, error: MessageError, stamp_ns: int | None) -> None:
        """Tell of a message that can't be used; the log now and then."""
        warning = self.outputs.rejections.note(topic, error.field, str(error))
        if warning is not None:
            self.get_logger().warning(warning)
        goal = None
        if stamp_ns is not None:
            goal = Goal(np.zeros(4), np.zeros(3), stamp_ns, topic)
        self.mission.ledger.reject(topic, str(error), goal)

    def _warn(self, topic: str, sentence: str) -> None:
        self.get_logger().warning(f"{topic}: {sentence}", throttle_duration_sec=5.0)

    def fault(self, sentence: str) -> None:
        """Tell of an error that nothing else has caught."""
        if not self._closing:
            self.get_logger().error(f"fault, the stream goes on: {sentence}")

    def _tick(self) -> None:
        self._spinning = threading.get_ident()
        with self.calls() as now_ns:
            self.mission.tick(now_ns)
            silent = not now_ns and time.monotonic() - self._born > CLOCK_PATIENCE
            if silent and self.mission.active:
                self.mission.wait_for_clock()
            for topic, count in self.outputs.rejections.untold().items():
                self.mission.ledger.count_refusals(topic, count)
        self.outputs.catch_up(self.mission, self.now_ns())

    def _look(self) -> None:
        for ear in self._ears:
            ear.look()

    def _report_health(self) -> None:
        with self.lock:
            now_ns, realtime = self.now_ns(), self.streamer.realtime
            self.outputs.report_health(self.mission, now_ns, realtime=realtime)

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
