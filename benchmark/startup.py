# SPDX-License-Identifier: Apache-2.0
"""What it costs to begin: compiling once, loading from the cache, memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmark.report import Table

_PROGRAM = """
import json, time
from pathlib import Path
begin = time.perf_counter()
import numpy as np
from riem_planner import OrientationObstacle, Problem, State, solve
imported = time.perf_counter()
place = lambda *q: State.from_quaternion_xyzw(np.array(q) / np.linalg.norm(q))
obstacle = OrientationObstacle(place(0.1, 0.3, 0.4, 0.9).orientation, strength=0.05)
solution = solve(Problem(place(0, 0, 0, 1), place(0.2, 0.5, 0.7, 0.5), 1.0, obstacles=(obstacle,)))
solved = time.perf_counter()
# Not by getrusage: its peak is never below that of the process that started this one.
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
peak = int(status["VmHWM"].split()[0]) / 1024.0
print(json.dumps([imported - begin, solved - imported, peak, solution.solved]))
"""


def _first_solve(cache: str | None) -> tuple[float, float, float]:
    """Seconds to import, seconds to the first answer after that, peak memory [MB]."""
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as where it is used
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = cache
    root = Path(__file__).resolve().parent.parent
    answer = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        env=environment,
        cwd=root,
        check=True,
        capture_output=True,
        text=True,
    )
    imported, solved, peak, right = json.loads(answer.stdout.splitlines()[-1])
    if not right:
        raise RuntimeError("the first solve did not succeed")
    return imported, solved, peak


def startup(compile_anew: bool, repeats: int = 3) -> Table:
    """Fresh processes: from the cache, and with an empty cache if asked."""
    table = Table("Start-up", "A fresh process that imports the planner and solves one problem.")
    _first_solve(None)  # fills the cache if it is empty
    runs = sorted(_first_solve(None) for _ in range(repeats))
    named = [("from the cache", runs[len(runs) // 2])]
    if compile_anew:
        with tempfile.TemporaryDirectory() as cache:
            named.append(("compiling everything", _first_solve(cache)))
    for name, (imported, solved, peak) in named:
        table.rows.append(
            {
                "start": name,
                "import s": imported,
                "first solve s": solved,
                "together s": imported + solved,
                "peak memory MB": peak,
            }
        )
    return table
