# SPDX-License-Identifier: Apache-2.0
"""Beginnings of messages as CDR bytes, the form in which they travel (little-endian, plain CDR)."""

from __future__ import annotations

import struct

from msg_adapters.geometry import SECOND

ENCAPSULATION = 4
"""Bytes before the payload, to which alignment is relative."""
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def aligned(offset: int, size: int) -> int:
    """The next offset at which a number of that many bytes may stand."""
    return ENCAPSULATION + -(-(offset - ENCAPSULATION) // size) * size


def padded(data: bytes, size: int) -> bytes:
    """The bytes up to where a number of that many bytes may stand."""
    return data + b"\0" * (aligned(len(data), size) - len(data))


def string(text: str) -> bytes:
    """A string, to be put where four bytes may stand."""
    encoded = text.encode() + b"\0"
    return struct.pack("<I", len(encoded)) + encoded


def header(nanoseconds: int, frame: str) -> bytes:
    """A message's beginning: std_msgs/Header."""
    seconds, rest = divmod(int(nanoseconds), SECOND)
    return _LITTLE_ENDIAN + struct.pack("<iI", seconds, rest) + string(frame)
