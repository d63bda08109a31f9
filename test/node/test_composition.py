# SPDX-License-Identifier: Apache-2.0
"""The example of a composition without a launch file: it arrives, and ends its nodes."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.soak
def test_the_example_of_a_composition_arrives():
    command = [sys.executable, "examples/composition.py", "--duration", "2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as example:
        try:
            told, _ = example.communicate(timeout=300.0)
        finally:
            example.terminate()  # which ends its nodes as well
    assert example.returncode == 0, told
    assert "ARRIVED" in told
