"""What the offline tests share."""

import pytest

from riem_planner.limits import Limits
from riem_planner.plan import solve, warm_up
from riem_planner.problem import Problem, State


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """Kernels in the cache on disk, so that no command that a test starts has to compile them."""
    warm_up()
    start = State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0])
    goal = State.from_quaternion_xyzw([0.0, 0.0, 0.6, 0.8])
    solve(Problem(start, goal, 10.0, limits=Limits(rate=1.0)))
