"""Puts this folder on the import path, so that tests in every room can share its helpers."""

import pytest

from riem_planner import warm_up


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """Kernels are compiled once, before any test or process of its own needs one.

    Two processes that compile side by side may order the same sums differently, in the last bit.
    """
    warm_up()
