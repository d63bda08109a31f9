# SPDX-License-Identifier: Apache-2.0
"""Puts the folders of helpers on the import path, so that tests in every room can share them."""

import sys
from pathlib import Path

import pytest

from riem_planner import warm_up

for folder in ("mission", "node", "page", "proof"):
    sys.path.insert(0, str(Path(__file__).parent / folder))


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """Kernels are compiled once, before any test or process of its own needs one.

    Two processes that compile side by side may order the same sums differently, in the last bit.
    """
    warm_up()
