# SPDX-License-Identifier: Apache-2.0
"""The sphere of directions as two flat discs: its near and its far half, nothing hidden.

Orthographic views of both halves along one axis; the far one is seen from behind, so that
a path that leaves one disc at its rim goes on at the mirrored place of the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIM = "0.35"
GRATICULE = "0.86"
_NAME_DISTANCE = 0.12  # of a name from its point, in radii of the disc


@dataclass(frozen=True, eq=False)
class SphereView:
    """Orthographic view of one half of the unit sphere on an axes.

    Parameters
    ----------
    axes
        Of Matplotlib.
    frame : (3, 3)
        Rows: to the right, up, and towards the eye, in the reference frame.
    """

    axes: Any
    frame: Array

    def prepare(self, title: str) -> Any:
        """Rim and graticule; returns the rim, which clips what is drawn."""
        from matplotlib.patches import Circle

        self.axes.set_aspect("equal")
        self.axes.set_axis_off()
        self.axes.set_xlim(-1.06, 1.06)
        self.axes.set_ylim(-1.06, 1.06)
        self.axes.set_title(title, fontsize=9, pad=2)
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        for latitude in np.radians(np.arange(-60, 90, 30)):
            ring = np.cos(latitude) * np.array([np.cos(turn), np.sin(turn)])
            self.line(np.vstack([ring, np.full(181, np.sin(latitude))]).T, **_GRATICULE)
        arc = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 91)
        for longitude in np.radians(np.arange(0, 360, 30)):
            flat = np.array([np.cos(longitude), np.sin(longitude)])[:, None] * np.cos(arc)
            self.line(np.vstack([flat, np.sin(arc)]).T, **_GRATICULE)
        rim = Circle((0.0, 0.0), 1.0, fill=False, edgecolor=RIM, linewidth=1.0, zorder=6)
        self.axes.add_patch(rim)
        return rim

    def sees(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (..., 3) of the sphere are on this half."""
        return np.asarray(points @ self.frame[2] >= 0.0)

    def project(self, points: Array) -> Array:
        """Places (..., 2) on the axes of points (..., 3) of the sphere."""
        return np.asarray(points @ self.frame[:2].T)

    def line(self, points: Array, **style: Any) -> None:
        """Draw the part on this half of the line through points (n, 3)."""
        places = np.where(self.sees(points)[:, None], self.project(points), np.nan)
        self.axes.plot(*places.T, **style)

    def point(self, point: Array, **style: Any) -> None:
        """Mark a point (3,) if it is on this half."""
        if self.sees(point):
            self.axes.plot(*self.project(point), linestyle="none", **style)

    def text(self, point: Array, text: str, **style: Any) -> None:
        """Write at a point (3,) if it is on this half."""
        if self.sees(point):
            self.axes.text(*self.project(point), text, ha="center", va="center", **style)

    def cap(self, axis: Array, half_angle: float, rim: Any, *, fill: dict[str, Any] | None,
            edge: dict[str, Any]) -> None:  # fmt: skip
        """Draw the cone of a half-angle [rad] about an axis (3,) as a cap, clipped by the rim."""
        # Above 0 inside the cone; beyond the rim the values of the rim go on, to be clipped.
        inside = (_SHEET @ self.frame) @ axis - np.cos(half_angle)
        if inside.max() <= 0.0:
            return
        if fill is not None:
            _clip(self.axes.contourf(_SIDE, _SIDE, inside, levels=[0.0, 4.0], **fill), rim)
        _clip(self.axes.contour(_SIDE, _SIDE, inside, levels=[0.0], **edge), rim)


def _clip(contours: Any, rim: Any) -> None:
    # Before Matplotlib 3.8 a set of contours is no artist itself.
    artists = [contours] if hasattr(contours, "set_clip_path") else contours.collections
    for artist in artists:
        artist.set_clip_path(rim)


_SIDE = np.linspace(-1.03, 1.03, 361)


def _sheet() -> Array:
    """Points (361, 361, 3) of the near half, in the view's frame, over the raster of `_SIDE`."""
    X, Y = np.meshgrid(_SIDE, _SIDE)
    shrink = 1.0 / np.maximum(np.hypot(X, Y), 1.0)
    X, Y = shrink * X, shrink * Y
    return np.stack([X, Y, np.sqrt(np.maximum(1.0 - X**2 - Y**2, 0.0))], axis=-1)


_SHEET = _sheet()
_GRATICULE: dict[str, Any] = {"color": GRATICULE, "linewidth": 0.6, "zorder": 0.7}


def view_frames(directions: Array) -> tuple[Array, Array]:
    """Frames of a near view that faces the mean of directions (n, 3), and of its far view."""
    mean = directions.mean(axis=0)
    if np.linalg.norm(mean) < 1e-6:
        mean = directions[0]
    toward = mean / np.linalg.norm(mean)
    up = np.array([0.0, 0.0, 1.0]) if abs(toward[2]) < 0.95 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    return np.array([right, up, toward]), np.array([-right, up, -toward])


def name_place(point: Array, drawn: Array) -> Array:
    """Where the name of a point (2,) of the disc is read best: beside it, far from what is drawn.

    The rim counts as drawn, so a name stays inside of it and never reaches a title.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    places = point + _NAME_DISTANCE * np.vstack([np.cos(turn), np.sin(turn)]).T
    to_drawn = np.linalg.norm(places[:, None] - drawn, axis=2).min(axis=1)
    to_rim = 1.0 - np.linalg.norm(places, axis=1)
    best: Array = places[np.argmax(np.minimum(to_drawn, to_rim))]
    return best
