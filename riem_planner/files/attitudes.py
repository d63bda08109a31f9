# SPDX-License-Identifier: Apache-2.0
"""Attitudes as people have them: one key each, named so that no order can be mistaken.

| key | means |
|---|---|
| `orientation` | unit quaternion [x, y, z, w] |
| `orientation_wxyz` | unit quaternion, scalar first |
| `rotation_vector` | axis times angle [rad] |
| `mrp` | modified Rodrigues parameters `q_vec / (1 + w)`, of any length |
| `matrix` | three rows of the rotation matrix |
| `euler` | `{sequence, angles_deg}`; `ZYX` about body axes in turn, `zyx` about fixed axes |
| `ra_dec_roll_deg` | right ascension and declination of the body's x axis, and the turn about it |

All of them turn body components into reference components.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import unit_quaternion
from riem_planner.errors import InvalidProblemError
from riem_planner.files.section import Section, shown, within
from riem_planner.geometry import so3

Array = NDArray[np.float64]

ATTITUDE_KEYS = (
    "orientation", "orientation_wxyz", "rotation_vector", "mrp", "matrix", "euler",
    "ra_dec_roll_deg",
)  # fmt: skip
"""The keys of which a mapping with an attitude has exactly one."""

_MATRIX_TOLERANCE = 1e-3  # of R^T R: typed digits; what is further off is a mistake
_EULER_KEYS = ("sequence", "angles_deg")


def read_attitude(section: Section) -> Array:
    """Unit quaternion (4,), x, y, z, w, of the attitude that a mapping states.

    Raises
    ------
    InvalidProblemError
        It states none, more than one, or one that is no attitude.
    """
    given = section.given(*ATTITUDE_KEYS)
    if not given:
        raise InvalidProblemError(
            section.key("orientation"),
            f"missing; give a unit quaternion [x, y, z, w], or one of {_listed(ATTITUDE_KEYS[1:])}",
        )
    if len(given) > 1:
        raise InvalidProblemError(
            section.path,
            f"expected exactly one of {_listed(ATTITUDE_KEYS)}, got {_listed(given)}",
        )
    return _READERS[given[0]](section, given[0])


def _listed(names: Any) -> str:
    return ", ".join(names)


def _xyzw(section: Section, key: str) -> Array:
    numbers = section.numbers(
        key, 4, expected="a unit quaternion [x, y, z, w] (scalar first is orientation_wxyz)"
    )
    with within(section.path):
        return unit_quaternion(key, numbers)


def _wxyz(section: Section, key: str) -> Array:
    w, x, y, z = section.numbers(key, 4, expected="a unit quaternion [w, x, y, z]")
    norm = math.hypot(w, x, y, z)
    with within(section.path):
        try:
            return unit_quaternion(key, [x, y, z, w])
        except InvalidProblemError:
            raise InvalidProblemError(
                key,
                f"expected a unit quaternion w, x, y, z, got {[w, x, y, z]} of norm {norm:.6g};"
                " normalise it",
            ) from None


def _rotation_vector(section: Section, key: str) -> Array:
    vector = section.numbers(key, 3, expected="axis times angle, three numbers in radians")
    return so3.quaternion_exp(vector)


def _mrp(section: Section, key: str) -> Array:
    p = np.array(section.numbers(key, 3, expected="q_vec / (1 + w), three numbers"))
    largest = max(1.0, float(np.max(np.abs(p))))  # so that no square overflows
    scaled, one = p / largest, 1.0 / largest
    square = float(scaled @ scaled)
    q = np.array([*(2.0 * one * scaled), one * one - square]) / (one * one + square)
    return np.asarray(q / np.linalg.norm(q))


def _matrix(section: Section, key: str) -> Array:
    rows = section.rows(key, 3, 3, expected="three rows of three numbers, body to reference")
    matrix = np.array(rows)
    error = float(np.max(np.abs(matrix.T @ matrix - np.eye(3))))
    determinant = float(np.linalg.det(matrix))
    if not error <= _MATRIX_TOLERANCE:
        raise InvalidProblemError(
            section.key(key),
            f"expected a rotation matrix, got one with |R^T R - I| = {error:.3g}; make its rows"
            f" orthogonal and of length 1 (within {_MATRIX_TOLERANCE:g})",
        )
    if determinant < 0.0:
        raise InvalidProblemError(
            section.key(key),
            f"expected a rotation matrix, got one of determinant {determinant:.3g}; it mirrors:"
            " swap two rows or change the sign of one, whichever axis is the wrong one",
        )
    left, _, right = np.linalg.svd(matrix)
    return so3.matrix_to_quaternion(left @ right)  # the nearest rotation


def _euler(section: Section, key: str) -> Array:
    euler = Section(section.key(key), section.value(key), _EULER_KEYS)
    expected = "three of XYZ (body axes) or of xyz (fixed axes), no letter twice in a row"
    sequence = euler.value("sequence", expected=expected)
    text = sequence if isinstance(sequence, str) else ""
    of_one_case = set(text) <= set("XYZ") or set(text) <= set("xyz")
    if len(text) != 3 or not of_one_case or text[0] == text[1] or text[1] == text[2]:
        raise InvalidProblemError(
            euler.key("sequence"), f"expected {expected}, got {shown(sequence)}"
        )
    angles = euler.numbers("angles_deg", 3, expected="three angles in degrees")
    return _in_turn(text, angles)


def _in_turn(sequence: str, angles_deg: list[float]) -> Array:
    """Quaternion (4,) of turns about axes in turn: body axes if upper case, fixed if lower."""
    q = np.array([0.0, 0.0, 0.0, 1.0])
    for letter, angle in zip(sequence, angles_deg, strict=True):
        axis = np.eye(3)["xyz".index(letter.lower())]
        turn = so3.quaternion_exp(math.radians(angle) * axis)
        pair = (q, turn) if letter.isupper() else (turn, q)
        q = so3.quaternion_multiply(*pair)
    return np.asarray(q / np.linalg.norm(q))


def _ra_dec_roll(section: Section, key: str) -> Array:
    ra, dec, roll = section.numbers(
        key, 3, expected="right ascension, declination and roll of the x axis in degrees"
    )
    if not -90.0 <= dec <= 90.0:
        raise InvalidProblemError(
            f"{section.key(key)}[1]", f"expected a declination from -90 to 90, got {dec:g}"
        )
    return _in_turn("ZYX", [ra, -dec, roll])


_READERS = {
    "orientation": _xyzw,
    "orientation_wxyz": _wxyz,
    "rotation_vector": _rotation_vector,
    "mrp": _mrp,
    "matrix": _matrix,
    "euler": _euler,
    "ra_dec_roll_deg": _ra_dec_roll,
}
