# SPDX-License-Identifier: Apache-2.0
"""The `riem_figures` command: the paper's figures, as printed and corrected, and a table.

Each figure has three columns: as the paper computes it, the same initial values with the
corrected equation, and the boundary-value problem with the end states of the curve without the
obstacle. Lines differ in dash, so that the figures read in grey print.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from riem_planner.geometry import sphere
from riem_planner.paper import paper
from riem_planner.paper.paper import Curve, Example
from riem_planner.plots.sphere_view import SphereView, name_place, view_frames
from riem_planner.solve import solve

Array = NDArray[np.float64]

_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "0.55", "linewidth": 2.6, "linestyle": "-", "zorder": 4},
    {"color": "black", "linewidth": 1.3, "linestyle": "-", "zorder": 5},
    {"color": "#0072B2", "linewidth": 1.5, "linestyle": (0, (6, 2)), "zorder": 5},
    {"color": "#D55E00", "linewidth": 1.5, "linestyle": (0, (2, 1.5)), "zorder": 5},
)
_TITLES = (
    "as the paper computes it\n(Euler, h = 1 ms, lift of the obstacle)",
    "same initial values, corrected\n(distance on the sphere, DOP853)",
    "same end states, corrected\n(boundary-value problem, certified)",
)


@dataclass(frozen=True, eq=False)
class Picture:
    """One figure of the paper.

    Parameters
    ----------
    name
        Of the file, without its ending.
    title
        What it shows.
    example
        Initial data.
    strengths
        The tau that are drawn.
    free
        What the curve without the obstacle is called.
    """

    name: str
    title: str
    example: Example
    strengths: tuple[float, ...]
    free: str


PICTURES = (
    Picture("figure1", "Figure 1: a geodesic with the obstacle on it (σ = 0)",
            paper.GEODESIC, (1.0,), "geodesic"),
    Picture("figure2", "Figure 2: the cubic in tension and the avoidance curve (σ = 1)",
            paper.CUBIC, (1.0,), "cubic"),
    Picture("figure3", "Figure 3: stronger obstacles (σ = 1)",
            paper.CUBIC, (50.0, 200.0, 400.0), "cubic"),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    example
        Which initial data.
    method
        How the curve was computed.
    strength
        tau.
    obstacle_time
        t_q [s].
    least_distance
        Least chord `|x - q|` between the curve and the obstacle.
    reference
        What the paper prints or the reproduction found; None where there is none.
    certified_distance
        Certified lower bound of the chord to the obstacle; None for initial values.
    """

    example: str
    method: str
    strength: float
    obstacle_time: float
    least_distance: float
    reference: float | None = None
    certified_distance: float | None = None


_REPRODUCED = {
    (0.10, 1.0): 1.255e-6,
    (0.12, 1.0): 2.780e-6,
    (0.14, 1.0): 5.279e-6,
    (0.30, 1.0): 7.498e-5,
    (0.30, 50.0): 1.904e-3,
    (0.30, 200.0): 7.759e-3,
    (0.30, 400.0): 1.622e-2,
}


@cache
def columns(picture: Picture) -> list[tuple[Array, list[tuple[str, Curve]]]]:
    """For each column of a figure its obstacle (3,) and its labelled curves."""
    example, taus = picture.example, picture.strengths
    place, lift = paper.paper_obstacle(example)
    literal = [(picture.free, paper.paper_literal(example, 0.0))]
    literal += [(_label(tau), paper.paper_literal(example, tau, lift)) for tau in taus]
    free = paper.corrected(example, 0.0)
    on_path = paper.boundary_value_problem(example, 1.0).obstacles[0]
    direction = on_path.direction_at(0.0)  # type: ignore[union-attr]
    initial = [(picture.free, free)]
    initial += [(_label(tau), paper.corrected(example, tau, direction)) for tau in taus]
    boundary = [(picture.free, free)]
    boundary += [
        (_label(tau), paper.planned(paper.boundary_value_problem(example, tau))) for tau in taus
    ]
    return [(place, literal), (direction, initial), (direction, boundary)]


def _label(tau: float) -> str:
    return f"τ = {tau:g}"


def draw(picture: Picture) -> Figure:
    """The figure: three spheres, and under each the distance to the obstacle over time."""
    parts = columns(picture)
    figure = Figure(figsize=(11.0, 7.4), layout="constrained")
    axes: Any = figure.subplots(2, 3, height_ratios=(1.65, 1.0))
    centre = parts[0][0]
    frame, _ = view_frames(centre[None])
    for column, (obstacle, curves) in enumerate(parts):
        _draw_sphere(SphereView(axes[0, column], frame), _TITLES[column], obstacle, curves)
        _draw_distances(axes[1, column], picture.example, obstacle, curves)
    least = min(
        float(np.min(sphere.angle(curve.points, obstacle)))
        for obstacle, curves in parts
        for _, curve in curves[1:]
    )
    for axis in axes[1]:
        # The curve without the obstacle meets it: its distance goes down without end.
        axis.set_ylim(0.3 * least, 4.0)
    axes[1, 0].set_ylabel("angle to the obstacle [rad]", fontsize=9)
    handles, labels = axes[1, 0].get_legend_handles_labels()
    marks = {"start": "o", "obstacle q": "x", "thrown off: rate ten times the initial one": "v"}
    for name, marker in marks.items():
        handles += axes[0, 0].plot([], [], color="black", marker=marker, ms=6, linestyle="none")
        labels.append(name)
    figure.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9, frameon=False
    )
    figure.suptitle(f"{picture.title}\n{_data(picture)}", fontsize=11)
    if picture.example is paper.CUBIC and picture.strengths == (1.0,):
        _draw_least_distance(axes[1, 0])
    return figure


def _data(picture: Picture) -> str:
    """The data of an example, and who chose them."""
    example = picture.example

    def vector(values: Array) -> str:
        return "(" + ", ".join(f"{x:g}" for x in values) + ")"

    initial = (
        f"v(0) = {vector(example.v)}, v'(0) = {vector(example.a)}, v''(0) = {vector(example.j)}"
    )
    ours = f"$t_q$ = {example.obstacle_time:g} s, T = {example.duration:g} s, h = 1 ms"
    if example is paper.GEODESIC:
        return f"{initial}; {ours}: all chosen here, the paper gives no data"
    return f"{initial} as printed; {ours} chosen here (no $t_q$ is printed)"


def _draw_least_distance(axes: Any) -> None:
    """Inset: the paper's curve where it passes the obstacle, for the obstacle times near its own.

    The chord to the obstacle at its least, with the published value as a line.
    """
    inset = axes.inset_axes((0.56, 0.2, 0.41, 0.4))
    times = np.linspace(0.09, 0.15, 7)
    chords = []
    for t_q in times:
        place, lift = paper.paper_obstacle(paper.CUBIC, float(t_q))
        chords.append(paper.paper_literal(paper.CUBIC, 1.0, lift).chord_distance(place))
    inset.plot(times, 1e6 * np.array(chords), color="#0072B2", marker="o", markersize=3)
    inset.axhline(1e6 * paper.PUBLISHED_DISTANCE, color="black", linestyle=":", linewidth=1.0)
    inset.text(0.05, 0.88, "dotted: 2.54e-06, as printed", fontsize=6, transform=inset.transAxes)
    inset.set_xlabel("$t_q$ [s]", fontsize=7, labelpad=1)
    inset.set_title("least chord, in 1e-06", fontsize=7, pad=2)
    inset.tick_params(labelsize=6.5)


def _draw_sphere(
    view: SphereView, title: str, obstacle: Array, curves: list[tuple[str, Curve]]
) -> None:
    view.prepare(title)
    for (_, curve), style in zip(curves, _STYLES, strict=False):
        view.line(curve.points, **style)
    start = curves[0][1].points[0]
    view.point(start, marker="o", markersize=5, color="black", zorder=7)
    view.point(obstacle, marker="x", markersize=8, markeredgewidth=1.6, color="black", zorder=7)
    lines = [view.project(curve.points[view.sees(curve.points)]) for _, curve in curves]
    _draw_axes(view, np.vstack([*lines, view.project(obstacle)[None]]))


def _draw_axes(view: SphereView, drawn: Array) -> None:
    """Names of the reference axes on the sphere, beside their points; `drawn` (n, 2) stay free."""
    for axis, name in zip(np.vstack([np.eye(3), -np.eye(3)]), ("x", "y", "z", "-x", "-y", "-z"),
                          strict=True):  # fmt: skip
        view.point(axis, marker="+", markersize=7, color="0.35", zorder=3)
        if axis @ view.frame[2] >= 0.0:
            place = name_place(view.project(axis), drawn)
            view.axes.text(*place, name, color="0.3", fontsize=9, ha="center", va="center",
                           zorder=8)  # fmt: skip


def _draw_distances(
    axes: Any, example: Example, obstacle: Array, curves: list[tuple[str, Curve]]
) -> None:
    for (label, curve), style in zip(curves, _STYLES, strict=False):
        angle = np.maximum(sphere.angle(curve.points, obstacle), 1e-7)
        axes.semilogy(curve.times, angle, label=label, **style)
        if np.isfinite(curve.ends):
            axes.plot(curve.times[-1], angle[-1], marker="v", ms=7, color=style["color"])
    axes.set_xlabel("time [s]", fontsize=9)
    axes.set_xlim(0.0, example.duration)
    axes.tick_params(labelsize=8)
    axes.grid(True, which="major", color="0.88", linewidth=0.6)


def overview() -> Figure:
    """The picture of docs/problem.md: the avoidance curves on the sphere, and their distance."""
    picture = PICTURES[2]
    obstacle, curves = columns(picture)[2]
    figure = Figure(figsize=(8.6, 4.1), layout="constrained")
    axes: Any = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    frame, _ = view_frames(obstacle[None])
    _draw_sphere(SphereView(axes[0], frame), "same end states, obstacle on the way", obstacle,
                 curves)  # fmt: skip
    end = curves[0][1].points[-1]
    SphereView(axes[0], frame).point(end, marker="s", markersize=5, color="black", zorder=7)
    _draw_distances(axes[1], picture.example, obstacle, curves)
    axes[1].set_yscale("linear")
    axes[1].set_ylim(0.0, None)
    axes[1].set_ylabel("angle to the obstacle [rad]", fontsize=9)
    dot, square, cross = (
        axes[0].plot([], [], marker=marker, color="black", linestyle="none", ms=5)[0]
        for marker in ("o", "s", "x")
    )
    handles, labels = axes[1].get_legend_handles_labels()
    figure.legend(
        [*handles, dot, square, cross],
        [*labels, "start", "goal", "obstacle q"],
        loc="outside lower center",
        ncols=7,
        fontsize=8.5,
        frameon=False,
        columnspacing=1.2,
    )
    return figure


def table() -> list[Row]:
    """Least distances: the paper's, its reproduction, and the corrected curves'."""
    rows = []
    for (t_q, tau), reference in _REPRODUCED.items():
        place, lift = paper.paper_obstacle(paper.CUBIC, t_q)
        curve = paper.paper_literal(paper.CUBIC, tau, lift)
        rows.append(Row("cubic", "paper literal", tau, t_q, curve.chord_distance(place), reference))
    for picture in PICTURES:
        example, name = picture.example, picture.free
        problem = paper.boundary_value_problem(example, 1.0)
        place = problem.obstacles[0].direction_at(0.0)  # type: ignore[union-attr]
        for tau in picture.strengths:
            initial = paper.corrected(example, tau, place)
            rows.append(
                Row(name, "corrected, initial values", tau, example.obstacle_time,
                    initial.chord_distance(place))
            )  # fmt: skip
            problem = paper.boundary_value_problem(example, tau)
            certificate = solve(problem).certificate
            rows.append(
                Row(name, "corrected, boundary values", tau, example.obstacle_time,
                    paper.planned(problem).chord_distance(place),
                    certified_distance=2.0 * math.sin(0.5 * certificate.clearance["q"])
                    if certificate else None)
            )  # fmt: skip
    return rows


_HEADINGS = (
    "example", "method", "tau", "t_q [s]", "least chord", "reference",
    "certified chord",
)  # fmt: skip


def _cells(row: Row) -> list[str]:
    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.3e}"

    return [
        row.example, row.method, f"{row.strength:g}", f"{row.obstacle_time:.2f}",
        number(row.least_distance), number(row.reference), number(row.certified_distance),
    ]  # fmt: skip


def write_table(rows: Sequence[Row], directory: Path) -> None:
    """Write table.csv and table.md."""
    cells = [_cells(row) for row in rows]
    with (directory / "table.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([_HEADINGS, *cells])
    lines = ["| " + " | ".join(line) + " |" for line in (_HEADINGS, *cells)]
    lines.insert(1, "|---|---|---|---|---|---|---|")
    lines += [
        "",
        f"The paper prints {paper.PUBLISHED_DISTANCE:.2e} for tau = 1 and no t_q: an obstacle at"
        " about 0.12 s; just where depends on how its lift is read.",
    ]
    (directory / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the figures and the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="riem_figures",
        description="Figures 1 to 3 of the paper, as printed and corrected, and a table of least"
        " distances.",
    )
    parser.add_argument("--output", default="figures", metavar="DIR", help="where to write them")
    parser.add_argument("--dpi", type=int, default=150, help="resolution of the pictures")
    options = parser.parse_args(arguments)
    directory = Path(options.output)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for picture in PICTURES:
            draw(picture).savefig(str(directory / f"{picture.name}.png"), dpi=options.dpi)
        overview().savefig(str(directory / "problem.png"), dpi=options.dpi)
        write_table(table(), directory)
    except OSError as error:
        print(f"riem_figures: cannot write to {directory}: {error.strerror}", file=sys.stderr)
        return 2
    print(f"wrote figure1.png, figure2.png, figure3.png, problem.png, table.csv, table.md to"
          f" {directory}")  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
