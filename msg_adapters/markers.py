# SPDX-License-Identifier: Apache-2.0
"""Markers of a plan on the unit sphere: paths, cones, the worst point, body axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.geometry import header

Array = NDArray[np.float64]
Key = tuple[str, int]

PATH = (0.10, 0.45, 0.85, 1.0)
KEEP_OUT = (0.85, 0.15, 0.10, 0.30)
KEEP_IN = (0.15, 0.65, 0.25, 0.22)
WORST = (1.00, 0.65, 0.00, 1.0)
TEXT = (0.95, 0.95, 0.95, 1.0)
AXES = ((0.9, 0.2, 0.2, 1.0), (0.2, 0.8, 0.2, 1.0), (0.2, 0.4, 0.9, 1.0))

_SECTORS, _RINGS = 36, 4
_AXIS_LENGTH = 0.12


class Cap(NamedTuple):
    """A zone as it is drawn: name, kind, direction (3,), half-angle [rad]."""

    name: str
    keep_in: bool
    direction: Array
    half_angle: float


class Scene(NamedTuple):
    """What a plan looks like.

    Attributes
    ----------
    paths : name -> (n, 3)
        Where each boresight points, on the unit sphere.
    caps
        The zones.
    worst : (label, (3,)) or None
        The point of least clearance and what to write beside it.
    attitudes : (m, 3, 3)
        Rotation matrices whose body axes are drawn.
    boresight : (3,)
        Body axis at whose tip the body axes are drawn.
    """

    paths: dict[str, Array]
    caps: tuple[Cap, ...]
    worst: tuple[str, Array] | None
    attitudes: Array
    boresight: Array


def _points(array: Array) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in np.asarray(array, dtype=float).tolist()]


def _color(rgba: Sequence[float]) -> ColorRGBA:
    r, g, b, a = rgba
    return ColorRGBA(r=r, g=g, b=b, a=a)


def _marker(key: Key, kind: int, width: float, rgba: Sequence[float]) -> Marker:
    marker = Marker(ns=key[0], id=key[1], type=kind, action=Marker.ADD, color=_color(rgba))
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = width
    return marker


def cap_triangles(direction: Array, half_angle: float, radius: float = 1.0) -> Array:
    """Triangles (3 n, 3) of a spherical cap, outward normals counter-clockwise."""
    axis = np.asarray(direction, dtype=float)
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    polar = np.linspace(0.0, half_angle, _RINGS + 1)
    around = np.linspace(0.0, 2.0 * math.pi, _SECTORS + 1)
    circle = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    grid = radius * (
        np.cos(polar)[:, None, None] * axis + np.sin(polar)[:, None, None] * circle[None]
    )
    inner, outer = grid[:-1], grid[1:]
    quads = [inner[:, :-1], outer[:, :-1], outer[:, 1:], inner[:, :-1], outer[:, 1:], inner[:, 1:]]
    return np.stack(quads, axis=2).reshape(-1, 3)


def _cap_markers(cap: Cap) -> list[Marker]:
    body = _marker(
        (f"zones/{cap.name}", 0), Marker.TRIANGLE_LIST, 1.0, KEEP_IN if cap.keep_in else KEEP_OUT
    )
    # A keep-in cap lies a little lower, so that a keep-out cap inside it is seen.
    body.points = _points(
        cap_triangles(cap.direction, cap.half_angle, 0.985 if cap.keep_in else 0.995)
    )
    label = _marker((f"zones/{cap.name}", 1), Marker.TEXT_VIEW_FACING, 0.07, TEXT)
    label.text = cap.name
    x, y, z = (1.06 * cap.direction).tolist()
    label.pose.position = Point(x=x, y=y, z=z)
    return [body, label]


def _axes_marker(scene: Scene) -> Marker:
    marker = _marker(("body_axes", 0), Marker.LINE_LIST, 0.006, (1.0, 1.0, 1.0, 1.0))
    origin = scene.attitudes @ scene.boresight
    ends = origin[:, None, :] + _AXIS_LENGTH * np.swapaxes(scene.attitudes, 1, 2)
    pairs = np.stack([np.broadcast_to(origin[:, None, :], ends.shape), ends], axis=2)
    marker.points = _points(pairs.reshape(-1, 3))
    colors = [_color(rgba) for rgba in AXES]
    marker.colors = [color for color in colors for _ in range(2)] * len(scene.attitudes)
    return marker


def _worst_markers(worst: tuple[str, Array]) -> list[Marker]:
    text, place = worst
    x, y, z = place.tolist()
    point = _marker(("worst_clearance", 0), Marker.SPHERE, 0.04, WORST)
    point.pose.position = Point(x=x, y=y, z=z)
    label = _marker(("worst_clearance", 1), Marker.TEXT_VIEW_FACING, 0.06, WORST)
    label.text = text
    label.pose.position = Point(x=1.1 * x, y=1.1 * y, z=1.1 * z)
    return [point, label]


def markers_from_scene(
    scene: Scene, nanoseconds: int, frame: str, previous: Iterable[Key] = ()
) -> tuple[MarkerArray, set[Key]]:
    """Markers of a scene, and their keys (namespace, id).

    A thing keeps its key from one message to the next; keys in `previous` that are gone are
    deleted, so that a viewer that missed nothing shows exactly this scene.
    """
    markers: list[Marker] = []
    for name, path in scene.paths.items():
        line = _marker((f"path/{name}", 0), Marker.LINE_STRIP, 0.012, PATH)
        line.points = _points(path)
        markers.append(line)
    for cap in scene.caps:
        markers.extend(_cap_markers(cap))
    if scene.worst is not None:
        markers.extend(_worst_markers(scene.worst))
    if len(scene.attitudes):
        markers.append(_axes_marker(scene))
    keys = {(marker.ns, marker.id) for marker in markers}
    for ns, index in sorted(set(previous) - keys):
        markers.append(Marker(ns=ns, id=index, action=Marker.DELETE))
    top = header(nanoseconds, frame)
    for marker in markers:
        marker.header = top
    return MarkerArray(markers=markers), keys
