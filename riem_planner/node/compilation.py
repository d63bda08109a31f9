# SPDX-License-Identifier: Apache-2.0
"""Compilation beside the node: the compiler holds the interpreter, and with it every thread.

A child process compiles into the folder in which kernels are kept, and this one then loads them.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from riem_planner.kernels import COMPILING, place

LOOK = 0.05
"""Time between two looks at the child [s]."""
_PROGRAM = "from riem_planner import warm_up; warm_up()"


def compile_beside(notify: Callable[[str], None], should_stop: Callable[[], bool]) -> None:
    """Have a child compile what is not kept yet; nothing is to be done where all is.

    Where nothing can be kept, or the child fails, this process compiles when it warms up.

    Parameters
    ----------
    notify
        Receives a sentence if it takes a while.
    should_stop
        Whether the child is to be ended.
    """
    spot = place()
    if spot.checked() or not spot.writable:
        return
    notify(COMPILING)
    package = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")]))
    child = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM],
        env={**os.environ, "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # a Ctrl-C in the terminal is this process's own
    )
    try:
        while not should_stop():
            try:
                child.wait(LOOK)
                return
            except subprocess.TimeoutExpired:
                continue
    finally:
        if child.poll() is None:
            child.kill()
            child.wait()
