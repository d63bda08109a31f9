# SPDX-License-Identifier: Apache-2.0
"""A picture of a timeline: the sky with its slews and conflicts, durations, the worst slews."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.riem_timeline.inputs import SkyZone, Spacecraft
from riem_planner.riem_timeline.schedule import Segment, conflicts, is_detour, worst_degrees

Array = NDArray[np.float64]

_COLOURS = {"straight": "0.75", "detour": "tab:blue", "conflict": "tab:red"}
_SAMPLES = 30  # of a slew on the map
_WORST = 12  # slews that are listed


def draw_report(
    segments: Sequence[Segment],
    straight_times: Array,
    spacecraft: Spacecraft,
    sky: Sequence[SkyZone],
    path: Path,
) -> None:
    """Write a figure of a timeline.

    Parameters
    ----------
    straight_times : (n,)
        Of the slews, in their order, blind to zones [s].
    path
        A file that Matplotlib can write (.png, .pdf, .svg).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.7, 1.0))
    _draw_sky(figure.add_subplot(grid[0, :], projection="mollweide"), segments, spacecraft, sky)
    slews = [segment for segment in segments if segment.kind == "slew"]
    _draw_durations(figure.add_subplot(grid[1, 0]), slews, straight_times)
    _list_worst(figure.add_subplot(grid[1, 1]), segments)
    left = len(conflicts(segments))
    figure.suptitle(
        f"{len(slews)} slews, {sum(map(is_detour, slews))} detours, {left} conflicts"
        f" in {(segments[-1].end - segments[0].start) / 86400:.1f} days"
    )
    figure.savefig(path, dpi=110)


def _draw_sky(
    axes: Any, segments: Sequence[Segment], spacecraft: Spacecraft, sky: Sequence[SkyZone]
) -> None:
    axes.grid(color="0.9", lw=0.5)
    for segment in segments:
        kind = "straight"
        if segment.reason is not None:
            kind = "conflict"
        elif is_detour(segment):
            kind = "detour"
        for piece in segment.motion.pieces:
            R, _, _ = piece.evaluate(np.linspace(0.0, piece.duration, _SAMPLES))
            longitude, latitude = _on_map(R @ spacecraft.boresight)
            width = 0.5 if kind == "straight" else 1.3
            axes.plot(longitude, latitude, color=_COLOURS[kind], lw=width)
    for zone in sky:
        longitude, latitude = _on_map(zone.directions)
        axes.plot(longitude, latitude, lw=1.0, ls=":", label=f"path of {zone.zone.body}")
    for kind, colour in _COLOURS.items():
        axes.plot([], [], color=colour, label=kind)
    axes.set_xticklabels([])
    axes.set_title("boresight on the sky (right ascension to the right, from -180 to 180 deg)")
    axes.legend(loc="lower right", fontsize=8)


def _on_map(directions: Array) -> tuple[Array, Array]:
    """Longitudes and latitudes [rad]; NaN where a line would cross the map."""
    longitude = np.arctan2(directions[:, 1], directions[:, 0])
    latitude = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
    jumps = np.flatnonzero(np.abs(np.diff(longitude)) > np.pi) + 1
    return np.insert(longitude, jumps, np.nan), np.insert(latitude, jumps, np.nan)


def _draw_durations(axes: Any, slews: Sequence[Segment], straight_times: Array) -> None:
    durations = np.array([segment.duration for segment in slews])
    edges = np.linspace(0.0, max(1.0, float(np.max(durations, initial=0.0))), 40)
    axes.hist(durations, edges, color="tab:blue", label="as flown")
    axes.hist(straight_times, edges, histtype="step", color="black", label="straight, blind")
    axes.set_yscale("log")
    axes.set_xlabel("duration of a slew [s]")
    axes.set_ylabel("slews")
    axes.legend()


def _list_worst(axes: Any, segments: Sequence[Segment]) -> None:
    axes.axis("off")
    axes.set_title("nearest to a zone, or in it", loc="left", fontsize=10)
    ordered = sorted((s for s in segments if s.motion.pieces), key=worst_degrees)
    lines = [
        f"{worst_degrees(s):8.3f} deg  observation {s.observation:5d}  {s.kind:5}"
        f"  {s.reason or s.verdict or 'clear'}"
        for s in ordered[:_WORST]
    ]
    axes.text(0.0, 0.95, "\n".join(lines), family="monospace", fontsize=9, va="top")


def straight_times(segments: Sequence[Segment], attitudes: Array, spacecraft: Spacecraft) -> Array:
    """Times of the slews [s] if there were no zones."""
    from riem_planner.surveys import slew_times

    rows = [segment.observation for segment in segments if segment.kind == "slew"]
    if not rows:
        return np.empty(0)
    goals = np.array(rows)
    return slew_times(attitudes[goals - 1], attitudes[goals], limits=spacecraft.limits).time
