# SPDX-License-Identifier: Apache-2.0
"""Lifecycle transitions beside the executor, which a stop or a compilation must never hold.

rclpy calls a transition in the executor's thread and answers when it returns. Here a thread of its
own carries transitions out, one after the other, and each request is answered when its transition
has ended; the executor hears everything meanwhile, /clock too.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.exceptions import InvalidHandle
from rclpy.service import Service

Change = Callable[[ChangeState.Request, ChangeState.Response], ChangeState.Response]


class Transitions:
    """Carries transitions out in a thread of its own.

    Parameters
    ----------
    service
        That of ~/change_state, as rclpy made it.
    is_possible
        Whether a request asks for a transition that the present state has.
    fault
        Called with a sentence about anything that went wrong.
    """

    def __init__(
        self,
        service: Service,
        is_possible: Callable[[ChangeState.Request], bool],
        fault: Callable[[str], None],
    ) -> None:
        self._is_possible, self._fault = is_possible, fault
        self._change: Change = service.callback
        self._answer = service.send_response
        self._deferred: dict[int, ChangeState.Request] = {}
        self._queue: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        service.callback = self._take
        service.send_response = self._send
        self._thread = threading.Thread(target=self._run, name="transitions", daemon=True)
        self._thread.start()

    def do(self, work: Callable[[], None]) -> None:
        """Carry something out after what is under way."""
        self._queue.put(work)

    def close(self, timeout: float) -> bool:
        """End the thread; whether it has ended within a time [s]."""
        self._queue.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def _take(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        response.success = False
        if self._is_possible(request):
            self._deferred[id(response)] = request
        return response

    def _send(self, response: ChangeState.Response, header: Any) -> None:
        """Answer at once where nothing is to be done, else when it has been."""
        request = self._deferred.pop(id(response), None)
        if request is None:
            self._answer(response, header)
            return

        def work() -> None:
            # What was possible when it was asked for may no longer be.
            if self._is_possible(request):
                self._change(request, response)
            with suppress(InvalidHandle):  # the node has been destroyed meanwhile
                self._answer(response, header)

        self.do(work)

    def _run(self) -> None:
        while True:
            work = self._queue.get()
            if work is None:
                return
            try:
                work()
            except Exception as error:  # a refusal by the state machine, or a fault
                self._fault(f"{type(error).__name__}: {error}")
