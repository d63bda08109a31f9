# SPDX-License-Identifier: Apache-2.0
"""How the project compiles: one decorator, so that every kernel has the same settings.

Kernels are compiled by Numba on first use and cached on disk; all but brief ones release the
interpreter lock, so that a solve in a worker thread never delays the stream of setpoints.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba

from riem_planner.kernel_cache import Place, cached, place_of

# Reassociation and contraction let LLVM vectorise the reductions. Infinity keeps its meaning, but
# tests for it must be comparisons: `isfinite(x)` is `x - x == 0`, which reassociation makes true.
_FASTMATH = {"reassoc", "contract", "nsz", "arcp"}

# Where kernels are, and the constants that are compiled into them.
_COMPILED_ROOMS = (
    "kernels.py", "limit_rows.py", "trajectory.py", "geometry/*.py", "obstacles/*.py",
    "solver/*.py", "certificate/*.py", "least_time/*.py",
)  # fmt: skip
# A room whose kernels no other room's call: what changes there leaves the others' as they are.
_TOP_ROOMS = ("surveys",)
# Of these, the files that define kernels, and those that only hold constants for them.
_IMPORT, _CONSTANTS = (
    b"from riem_planner.kernels import",
    ("kernels.py", "limit_rows.py", "model.py", "table.py", "dop853.py", "tolerances.py"),
)

COMPILING = (
    "compiling the solver, once on this machine (a minute or so); later starts take a second"
)
"""What is told to whoever waits for it."""
_MESSAGE_AFTER = 1.5  # s; loading from the cache takes less


@cache
def place(top: str = "") -> Place:
    """Where kernels of just this source are kept; those of a top room by themselves.

    Numba looks at the file of a kernel only, not at those whose functions are compiled into it,
    so a change elsewhere would leave old machine code in use. A folder for each state of the
    package's sources rules that out.
    """
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for room in (*_COMPILED_ROOMS, *([f"{top}/*.py"] if top else [])):
        for source in sorted(package.glob(room)):
            text = source.read_bytes()
            if _IMPORT in text or source.name in _CONSTANTS:
                digest.update(text)
    return place_of(f"kernels-{digest.hexdigest()[:16]}")


def kernel(function: Callable[..., Any], *, nogil: bool = True) -> Callable[..., Any]:
    """Compile a function to machine code on first use, cached on disk, without the GIL."""
    rooms = function.__module__.split(".")
    kept = place(next((room for room in _TOP_ROOMS if room in rooms), ""))
    compiled = numba.njit(function, nogil=nogil, error_model="numpy", fastmath=_FASTMATH)
    return cached(compiled, function, kept)  # type: ignore[no-any-return]


def brief_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """A `kernel` of microseconds, which keeps the GIL.

    Where another thread waits for it, to get it back would take longer than the kernel does.
    """
    return kernel(function, nogil=False)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small function that LLVM is to expand where it is called."""
    return numba.njit(  # type: ignore[no-any-return]
        function,
        nogil=True,
        error_model="numpy",
        fastmath=_FASTMATH,
        forceinline=True,
        no_cpython_wrapper=True,  # never called from Python: a fifth less to compile
        no_cfunc_wrapper=True,
    )


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only kernels call, left to LLVM whether to expand it there."""
    return numba.njit(  # type: ignore[no-any-return]
        function,
        nogil=True,
        error_model="numpy",
        fastmath=_FASTMATH,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
    )


@contextmanager
def announced(notify: Callable[[str], None]) -> Any:
    """Call `notify` once if the body takes longer than loading cached kernels does.

    Parameters
    ----------
    notify
        Receives one sentence: what is going on and how long it takes.
    """
    timer = threading.Timer(
        _MESSAGE_AFTER,
        notify,
        [COMPILING],
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
