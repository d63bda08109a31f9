# SPDX-License-Identifier: Apache-2.0
"""What a slew between two attitudes comes to."""

from __future__ import annotations

from enum import IntEnum


class SlewVerdict(IntEnum):
    """Outcome of one pair; a slew exists where it is STRAIGHT or DETOUR."""

    STRAIGHT = 0
    """The slew about the eigenaxis is certified clear."""
    DETOUR = 1
    """Another path is certified: clear, and within the limits."""
    SEALED = 2
    """Proven: zones part the boresight's start from its goal, so that no path exists."""
    NOT_FOUND = 3
    """No path was found, and that there is none was not proven."""
    START_IN_ZONE = 4
    """The start is in a zone or on its edge."""
    GOAL_IN_ZONE = 5
    """The goal is in a zone or on its edge."""
    INVALID = 6
    """An input is not finite."""

    @property
    def has_slew(self) -> bool:
        """Whether there is a certified slew."""
        return self <= SlewVerdict.DETOUR
