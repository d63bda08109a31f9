# SPDX-License-Identifier: Apache-2.0
"""PoseArray as CDR bytes, read and written by NumPy.

A list of poses as Python objects takes 10 microseconds a pose to build or to read, all of it
with the interpreter lock held: 100,000 of them would stop the stream for a second. As bytes it
takes microseconds in all, and the result is identical byte for byte.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msg_adapters import cdr
from msg_adapters.errors import MessageError
from msg_adapters.geometry import SECOND, UNIT_TOLERANCE, check_frame

Array = NDArray[np.float64]


class Orientations(NamedTuple):
    """Attitudes that came in one message.

    Attributes
    ----------
    quaternions : (n, 4)
        Unit, x, y, z, w.
    stamp : int
        [ns]; 0 means now.
    """

    quaternions: Array
    stamp: int


def cdr_from_orientations(quaternions: Array, nanoseconds: int, frame: str) -> bytes:
    """Serialised PoseArray of quaternions (n, 4) in the order x, y, z, w, at the origin."""
    quaternions = np.asarray(quaternions, dtype=float)
    head = cdr.padded(cdr.header(nanoseconds, frame), 4) + struct.pack("<I", len(quaternions))
    if len(quaternions) == 0:
        return head
    head = cdr.padded(head, 8)
    poses = np.zeros((len(quaternions), 7), dtype="<f8")
    poses[:, 3:] = quaternions
    return head + poses.tobytes()


def orientations_from_cdr(data: bytes, reference_frame: str, most: int) -> Orientations:
    """Orientations of a serialised PoseArray; positions are ignored.

    Parameters
    ----------
    data
        The message as it came.
    reference_frame
        The frame its header must name.
    most
        The largest number of poses that is accepted.

    Raises
    ------
    MessageError
        A value is wrong, or the bytes are no PoseArray.
    """
    try:
        return _orientations(data, reference_frame, most)
    except (struct.error, UnicodeDecodeError) as error:
        raise MessageError("(whole message)", f"{len(data)} bytes", "a PoseArray") from error


def _orientations(data: bytes, reference_frame: str, most: int) -> Orientations:
    order = "<" if data[1:2] == b"\x01" else ">"
    seconds, rest, length = struct.unpack_from(order + "iII", data, cdr.ENCAPSULATION)
    if seconds < 0 or rest >= SECOND:
        raise MessageError(
            "header.stamp", f"{seconds} s {rest} ns", "a stamp from zero on with less than 1e9 ns"
        )
    offset = cdr.ENCAPSULATION + 12
    name = bytes(data[offset : offset + length]).rstrip(b"\0").decode()
    check_frame("header.frame_id", name, reference_frame)
    offset = cdr.aligned(offset + length, 4)
    (count,) = struct.unpack_from(order + "I", data, offset)
    if count > most:
        raise MessageError("poses", f"{count} of them", f"at most {most} obstacles")
    offset = cdr.aligned(offset + 4, 8) if count else offset + 4
    if len(data) < offset + 56 * count:
        raise MessageError("(whole message)", f"{len(data)} bytes", f"{count} poses")
    poses = np.frombuffer(data, dtype=order + "f8", count=7 * count, offset=offset)
    quaternions = _unit(poses.reshape(count, 7)[:, 3:].astype(float))
    return Orientations(quaternions, seconds * SECOND + rest)


def _unit(quaternions: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.linalg.norm(quaternions, axis=1)
        wrong = ~(np.abs(norms - 1.0) <= UNIT_TOLERANCE)
    if wrong.any():
        index = int(np.argmax(wrong))
        value = f"{quaternions[index].tolist()} (norm {norms[index]:.6g})"
        raise MessageError(
            f"poses[{index}].orientation", value, "a unit quaternion x, y, z, w; normalise it"
        )
    return np.asarray(quaternions / norms[:, None])
