# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a message, in a form that can be counted and shown."""

from __future__ import annotations


class MessageError(ValueError):
    """A field of a message can't be used.

    Parameters
    ----------
    field
        Path of the field in the message (`pose.orientation`).
    value
        What it held, as text.
    expected
        What was expected, and what to do.
    """

    def __init__(self, field: str, value: object, expected: str) -> None:
        self.field = field
        self.value = str(value)
        self.expected = expected
        super().__init__(f"{field} = {self.value}: expected {expected}")
