# SPDX-License-Identifier: Apache-2.0
"""The errors of the package, one class per cause."""

from __future__ import annotations


class RiemPlannerError(Exception):
    """Root of every error that the package raises on purpose."""


class InvalidProblemError(RiemPlannerError, ValueError):
    """A value of a problem is wrong; the message says what was expected, what came, what to do.

    Parameters
    ----------
    key
        Name of the offending value, as in a problem file (`start.orientation`).
    problem
        What is wrong with it and what to do.
    """

    def __init__(self, key: str, problem: str) -> None:
        self.key = key
        self.problem = problem
        super().__init__(f"{key}: {problem}")
