# SPDX-License-Identifier: Apache-2.0
"""The figure of a plan: boresight paths among the zones, rates, accelerations, clearance.

Lines differ in dash and marker, zones in hatching, so that the figure reads in grey print.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from riem_planner.certificate import Certificate, certify, clearance_along
from riem_planner.geometry import so3
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.plots.sphere_view import RIM, SphereView, view_frames
from riem_planner.plots.straight import straight_slew
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES = 401
_MOST = 6  # zones that a legend has room for, and that there are styles for
# Colours of different lightness (Okabe and Ito), each with a marker of its own.
_STYLES = (
    ("black", "o"),
    ("#0072B2", "s"),
    ("#D55E00", "^"),
    ("#009E73", "D"),
    ("#CC79A7", "v"),
    ("#56B4E9", "P"),
)
_SMALL = math.radians(6.0)  # half-angle of a zone that a letter would cover
_STRAIGHT: dict[str, Any] = {"linestyle": (0, (4, 3)), "linewidth": 0.9}
_LABEL: dict[str, Any] = {"fontsize": 8}


def plot_plan(
    problem: Problem,
    trajectory: Trajectory,
    path: Path | str,
    certificate: Certificate | None = None,
) -> None:
    """Write the figure of a trajectory to a file.

    Parameters
    ----------
    problem, trajectory, certificate
        As for `plan_figure`.
    path
        The file; its ending decides the format (png, pdf, svg).
    """
    plan_figure(problem, trajectory, certificate).savefig(str(path), dpi=160)


def plan_figure(
    problem: Problem, trajectory: Trajectory, certificate: Certificate | None = None
) -> Figure:
    """Figure of a trajectory.

    Parameters
    ----------
    problem
        What was planned; its zones are drawn, its straight slew is dashed.
    trajectory
        What is to be flown.
    certificate
        Of the trajectory; by default it is certified here.
    """
    if certificate is None:
        certificate = certify(trajectory, problem)
    figure = Figure(figsize=(10.0, 7.6), layout="constrained")
    parts: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.25))
    left, right = parts
    end = trajectory.evaluate(trajectory.duration)[0]
    straight = straight_slew(problem, end=end)
    _draw_sphere(left, problem, trajectory, straight)
    panels = right.subplots(3, 1, sharex=True)
    _draw_motion(panels[0], panels[1], trajectory)
    _draw_clearance(panels[2], problem, trajectory, straight, certificate)
    panels[2].set_xlabel("time [s]", **_LABEL)
    panels[2].set_xlim(0.0, trajectory.duration)
    figure.suptitle(_title(problem, certificate, end), fontsize=11)
    return figure


def _title(problem: Problem, certificate: Certificate, end: Array) -> str:
    start, goal = problem.start.orientation, problem.shown_arrival(end).orientation
    what = "attitude" if problem.space.name == "so3" else "pointing"
    if what == "attitude":
        angle = float(so3.distance(start, goal))
    else:
        ends = start @ problem.boresight, goal @ problem.boresight
        angle = math.atan2(float(np.linalg.norm(np.cross(*ends))), float(ends[0] @ ends[1]))
    verdict = "certified" if certificate.certified else "NOT CERTIFIED"
    name = f"{problem.name}: " if problem.name else ""
    return f"{name}{what} {math.degrees(angle):.1f}° apart, {problem.duration:.6g} s, {verdict}"


def _boresights(problem: Problem) -> list[tuple[Array, str]]:
    """Distinct body axes that zones watch, each with the names of the zones it serves."""
    axes: list[tuple[Array, list[str]]] = []
    for obstacle in problem.obstacles:
        own = obstacle.boresight if isinstance(obstacle, Zone) else None
        axis = np.asarray(problem.boresight if own is None else own)
        for known, names in axes:
            if np.allclose(known, axis, rtol=0.0, atol=1e-9):
                names.append(str(obstacle.name))
                break
        else:
            axes.append((axis, [str(obstacle.name)]))
    if not axes:
        axes.append((np.asarray(problem.boresight), []))
    return [(axis, _axis_name(axis)) for axis, _ in axes]


def _axis_name(axis: Array) -> str:
    for i, letter in enumerate("xyz"):
        if abs(abs(axis[i]) - 1.0) < 1e-9:
            return f"body {'-' if axis[i] < 0.0 else '+'}{letter}"
    return "body [" + ", ".join(f"{component:.2f}" for component in axis) + "]"


def _draw_sphere(
    figure: Any, problem: Problem, trajectory: Trajectory, straight: Trajectory
) -> None:
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    attitudes = trajectory.evaluate(times)[0]
    straight_attitudes = straight.evaluate(times)[0]
    boresights = _boresights(problem)
    zone_axes = [o.direction_at(0.0) for o in problem.obstacles if isinstance(o, Zone)]
    first = attitudes @ boresights[0][0]
    frames = view_frames(np.vstack([first, *[np.tile(axis, (40, 1)) for axis in zone_axes[:1]]]))
    entries = min(len({_place(o) for o in problem.obstacles}), _MOST + 1) + len(boresights) + 3
    ratios = (1.0, 1.0, 0.05 * math.ceil(entries / 2))
    *axes, key_axes = figure.subplots(3, 1, gridspec_kw={"height_ratios": ratios})
    handles: list[Any] = []
    for view_axes, frame, title in zip(axes, frames, ("near side", "far side"), strict=True):
        view = SphereView(view_axes, frame)
        rim = view.prepare(title)
        handles = _draw_zones(view, rim, problem)
        for (axis, name), (color, marker) in zip(boresights, _cycle(len(boresights)), strict=True):
            path = attitudes @ axis
            view.line(path, color=color, linewidth=1.6, zorder=5)
            view.line(straight_attitudes @ axis, color=color, zorder=4, **_STRAIGHT)
            for k in range(50, _SAMPLES - 1, 50):
                view.point(path[k], marker=marker, markersize=3, color=color, zorder=5)
            _mark_end(view, path[0], "o", color)
            _mark_end(view, path[-1], "*", color)
            handles.append(Line2D([], [], color=color, marker=marker, markersize=3, label=name))
    handles += _end_handles()
    key_axes.set_axis_off()
    key_axes.legend(
        handles=handles,
        loc="center",
        ncols=2,
        columnspacing=1.2,
        fontsize=7.5,
        frameon=False,
    )


def _mark_end(view: SphereView, point: Array, marker: str, color: str) -> None:
    size = 7 if marker == "o" else 11
    view.point(
        point, marker=marker, markersize=size, markerfacecolor="white", markeredgecolor=color,
        markeredgewidth=1.3, zorder=7,
    )  # fmt: skip


def _end_handles() -> list[Any]:
    hollow: dict[str, Any] = {
        "markerfacecolor": "white",
        "markeredgecolor": "black",
        "linestyle": "none",
    }
    return [
        Line2D([], [], marker="o", markersize=6, label="start", **hollow),
        Line2D([], [], marker="*", markersize=9, label="goal", **hollow),
        Line2D([], [], color="black", label="straight slew", **_STRAIGHT),
    ]


def _cycle(count: int) -> list[tuple[str, str]]:
    return [_STYLES[i % len(_STYLES)] for i in range(count)]


def _draw_zones(view: SphereView, rim: Any, problem: Problem) -> list[Any]:
    """Zones on one half, each with a letter; returns the entries of the legend."""
    handles: list[Any] = []
    letters = iter("ABCDEFGHIJKLMNOPQRSTUVWXYZ" * 4)
    drawn: dict[tuple[Any, ...], tuple[str, list[str]]] = {}
    for obstacle in problem.obstacles:
        key = _place(obstacle)
        if key in drawn:
            drawn[key][1].append(str(obstacle.name))
            continue
        letter = next(letters)
        drawn[key] = letter, [str(obstacle.name)]
        if isinstance(obstacle, OrientationObstacle):
            point = obstacle.orientation @ problem.boresight
            view.point(point, marker="x", markersize=6, color=RIM, zorder=3)
            view.text(_beside(view, point), letter, **_LETTER)
        else:
            _draw_zone(view, rim, obstacle, letter, problem.duration)
    for key, (letter, names) in [*drawn.items()][:_MOST]:
        handles.append(_zone_handle(key, f"{letter}  {_short(', '.join(names))}"))
    if len(drawn) > _MOST:
        handles.append(Patch(alpha=0.0, label=f"and {len(drawn) - _MOST} more"))
    return handles


def _short(text: str, most: int = 26) -> str:
    """The text, cut where a legend has no room for more."""
    return text if len(text) <= most else text[: most - 1] + "…"


_LETTER: dict[str, Any] = {
    "fontsize": 8,
    "zorder": 8,
    "bbox": {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "0.6", "lw": 0.5},
}


def _place(obstacle: Any) -> tuple[Any, ...]:
    """What two zones share that look the same on the sphere."""
    if isinstance(obstacle, OrientationObstacle):
        return ("orientation", *obstacle.orientation.ravel())
    radius, axis = float(obstacle.radius_at(0.0)), obstacle.direction_at(0.0)
    return (obstacle.kind, round(radius, 9), *np.round(axis, 6))


def _draw_zone(view: SphereView, rim: Any, zone: Zone, letter: str, duration: float) -> None:
    out = zone.kind == "keep_out"
    fill = {"colors": "none", "hatches": ["////"]} if out else {"colors": ["0.94"]}
    edge: dict[str, Any] = {"colors": "0.25" if out else "0.45", "linewidths": 1.1, "zorder": 2}
    edge["linestyles"] = "solid" if out else "dashed"
    axis, radius = zone.direction_at(0.0), float(zone.radius_at(0.0))
    if radius == 0.0:
        view.point(axis, marker="x", markersize=6, color="0.25", zorder=3)
        view.text(_beside(view, axis), letter, **_LETTER)
        return
    view.cap(axis, radius, rim, fill=fill | {"zorder": 1 if out else 0.5}, edge=edge)
    if zone.greatest_speed > 0.0:
        end = zone.direction_at(duration)
        view.cap(
            end,
            float(zone.radius_at(duration)),
            rim,
            fill=None,
            edge=edge | {"linestyles": "dotted"},
        )
        view.line(
            zone.direction_at(np.linspace(0.0, duration, 61)), color="0.25", linestyle=":",
            linewidth=0.9,
        )  # fmt: skip
    if not out:
        axis = _on_edge(view, axis, radius)
    elif radius < _SMALL:
        axis = _beside(view, axis)
    view.text(axis, letter, **_LETTER)


def _beside(view: SphereView, point: Array) -> Array:
    moved = np.asarray(point + 0.09 * view.frame[0] + 0.05 * view.frame[1])
    return np.asarray(moved / np.linalg.norm(moved))


def _on_edge(view: SphereView, axis: Array, half_angle: float) -> Array:
    """The uppermost visible point of a cap's edge."""
    across = np.cross(axis, view.frame[0])
    across /= max(float(np.linalg.norm(across)), 1e-9)
    other = np.cross(axis, across)
    turn = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    edge = math.cos(half_angle) * axis + math.sin(half_angle) * (
        np.cos(turn) * across + np.sin(turn) * other
    )
    visible = edge[(edge @ view.frame[2]) > 0.1]
    if visible.size == 0:
        return np.asarray(-view.frame[2])
    return np.asarray(visible[np.argmax(visible @ view.frame[1])])


def _zone_handle(key: tuple[Any, ...], label: str) -> Any:
    kind = key[0]
    if kind == "orientation" or key[1] == 0.0:
        return Line2D([], [], color="0.25", marker="x", linestyle="none", label=label)
    label = f"{label}, {kind.replace('_', ' ')} {math.degrees(key[1]):.3g}°"
    if kind == "keep_out":
        return Patch(facecolor="none", edgecolor="0.25", hatch="////", label=label)
    return Patch(facecolor="0.94", edgecolor="0.45", linestyle="--", label=label)


def _draw_motion(rate_axes: Any, acceleration_axes: Any, trajectory: Trajectory) -> None:
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    _, rates, accelerations = trajectory.evaluate_quaternion(times)
    for axes, values, unit, what in (
        (rate_axes, rates, "deg/s", "body rate"),
        (acceleration_axes, accelerations, "deg/s²", "body acceleration"),
    ):
        for i, (color, marker) in enumerate(_cycle(3)):
            axes.plot(
                times, np.degrees(values[:, i]), color=color, marker=marker, markersize=3,
                markevery=(13 * i, 40), linewidth=1.2, label="xyz"[i],
            )  # fmt: skip
        norm = np.degrees(np.linalg.norm(values, axis=1))
        axes.plot(times, norm, color="0.55", linewidth=2.2, zorder=1, label="norm")
        axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
        axes.set_ylabel(f"{what} [{unit}]", **_LABEL)
        _finish(axes, ncols=4)


def _draw_clearance(
    axes: Any,
    problem: Problem,
    trajectory: Trajectory,
    straight: Trajectory,
    certificate: Certificate,
) -> None:
    axes.set_ylabel("distance to the forbidden set [deg]", **_LABEL)
    if not problem.obstacles:
        axes.text(0.5, 0.5, "no obstacles", transform=axes.transAxes, ha="center", **_LABEL)
        return
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    margins = clearance_along(trajectory, problem, times)
    straight_margins = clearance_along(straight, problem, times)
    by_margin = sorted(margins, key=lambda name: float(margins[name].min()))
    tightest = [name for name in margins if name in by_margin[:_MOST]]
    for i, (name, (color, marker)) in enumerate(zip(tightest, _cycle(len(tightest)), strict=True)):
        values = margins[name]
        bound = math.degrees(certificate.clearance.get(name, math.nan))
        axes.plot(
            times, np.degrees(values), color=color, marker=marker, markersize=3,
            markevery=(11 * i, 40), linewidth=1.4, label=f"{_short(name)}: at least {bound:.3g}°",
        )  # fmt: skip
        axes.axhline(bound, color=color, linestyle=":", linewidth=1.0)
        axes.plot(times, np.degrees(straight_margins[name]), color=color, **_STRAIGHT)
    lowest = min(0.0, *(float(np.degrees(straight_margins[name].min())) for name in tightest))
    bottom = 1.15 * lowest - 1.0
    axes.axhspan(bottom, 0.0, facecolor="none", edgecolor="0.75", hatch="////", linewidth=0.0)
    axes.axhline(0.0, color="0.25", linewidth=1.0)
    axes.set_ylim(bottom=bottom)
    handles = axes.get_legend_handles_labels()[0]
    if len(margins) > len(tightest):
        handles.append(Patch(alpha=0.0, label=f"and {len(margins) - _MOST} more, farther"))
    handles.append(Line2D([], [], color="0.25", linestyle=":", label="certified bound"))
    handles.append(Line2D([], [], color="0.25", label="straight slew", **_STRAIGHT))
    _finish(axes, ncols=2, handles=handles)


def _finish(axes: Any, *, ncols: int, handles: list[Any] | None = None) -> None:
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(
        **({} if handles is None else {"handles": handles}),
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=ncols, fontsize=7.5, frameon=False,
        borderaxespad=0.1,
    )  # fmt: skip
