# SPDX-License-Identifier: Apache-2.0
"""The figure of a plan: what it shows, and that nothing in it covers anything else."""

import inspect
import itertools
import json
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from riem_planner.files.problem_files import parse_problem, read_problem
from riem_planner.plots import plots, sphere_view
from riem_planner.plots.plots import plan_figure, plot_plan
from riem_planner.plots.sphere_view import SphereView, name_place, view_frames
from riem_planner.plots.straight import straight_slew
from riem_planner.solve import solve

ROOT = Path(__file__).resolve().parents[2]
TEXTBOOK = (ROOT / "config/problems/textbook.jsonl").read_text(encoding="utf-8").splitlines()


def many_zones():
    """A problem with more zones than a legend has room for, one of them moving."""
    problem = parse_problem(json.loads(TEXTBOOK[3]))
    zone = problem.obstacles[0]
    directions = np.random.default_rng(5).normal(size=(14, 3))
    zones = tuple(
        replace(zone, name=f"a rather long name {i}", direction=d, half_angle=0.05)
        for i, d in enumerate(directions)
    )
    return replace(problem, obstacles=(replace(zones[0], rate=[0, 0, 0.2]), *zones[1:]))


PROBLEMS = {
    "published": read_problem(ROOT / "config/problems/bevo2_case2.yaml"),
    "orientation": parse_problem(json.loads(TEXTBOOK[1])),
    "s2": parse_problem(json.loads(TEXTBOOK[2])),
    "many": many_zones(),
    "none": replace(parse_problem(json.loads(TEXTBOOK[0])), obstacles=()),
}


def drawn(name):
    problem = PROBLEMS[name]
    solution = solve(problem)
    trajectory = solution.trajectory if solution.solved else straight_slew(problem)
    figure = plan_figure(problem, trajectory)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return figure, canvas


def panels(figure):
    return [axes for part in figure.subfigs for axes in part.axes]


@pytest.mark.parametrize("name", PROBLEMS)
def test_no_text_covers_another_or_leaves_the_figure(name):
    figure, canvas = drawn(name)
    renderer = canvas.get_renderer()
    boxes = [figure._suptitle.get_window_extent(renderer)]
    for axes in panels(figure):
        if axes.get_legend() is not None:
            boxes.append(axes.get_legend().get_window_extent(renderer))
        for text in (axes.title, axes.xaxis.label, axes.yaxis.label):
            if text.get_text():
                boxes.append(text.get_window_extent(renderer))
        if axes.axison:
            boxes.append(axes.get_window_extent(renderer))
    for box in boxes:
        assert min(box.x0, box.y0) >= -1, box
        assert max(box.x1 - figure.bbox.x1, box.y1 - figure.bbox.y1) <= 1, box
    for one, other in itertools.combinations(boxes, 2):
        width = min(one.x1, other.x1) - max(one.x0, other.x0)
        height = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert width <= 1 or height <= 1, (one, other)


def test_published_plan_shows_zones_bounds_and_verdict():
    figure, _ = drawn("published")
    near, far, key, rate, acceleration, clearance = panels(figure)
    assert "certified" in figure._suptitle.get_text()
    assert near.get_aspect() == far.get_aspect() == 1.0
    labels = [text.get_text() for text in key.get_legend().get_texts()]
    assert "A  star_tracker_sun, keep out 20°" in labels
    assert "B  sun_sensor_y, sun_sensor_z, keep in 70°" in labels
    assert {"body +x", "body +y", "body +z", "start", "goal", "straight slew"} <= {*labels}
    assert "deg/s]" in rate.get_ylabel()
    assert "deg/s²]" in acceleration.get_ylabel()
    shown = [text.get_text() for text in clearance.get_legend().get_texts()]
    assert any(text.startswith("sun_sensors: at least ") for text in shown)
    assert clearance.get_ylim()[0] < 0.0  # the straight slew goes below


def test_refused_trajectory_is_called_so():
    problem = PROBLEMS["published"]
    figure = plan_figure(problem, straight_slew(problem))
    assert "NOT CERTIFIED" in figure._suptitle.get_text()


def test_point_is_on_exactly_one_half_and_where_it_belongs():
    near, far = view_frames(np.array([[0.6, 0.0, 0.8]]))
    points = np.random.default_rng(2).normal(size=(100, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    views = SphereView(None, near), SphereView(None, far)
    assert np.all(views[0].sees(points) ^ views[1].sees(points))
    np.testing.assert_allclose(views[0].project(np.array([0.6, 0.0, 0.8])), 0.0, atol=1e-15)
    np.testing.assert_allclose(near @ near.T, np.eye(3), atol=1e-15)
    # A path that leaves one disc goes on at the mirrored place of the other.
    one, other = views[0].project(points), views[1].project(points)
    np.testing.assert_allclose(one * [-1.0, 1.0], other, atol=1e-15)


def test_plot_leaves_no_global_state(tmp_path):
    before = dict(mpl.rcParams)
    plot_plan(PROBLEMS["none"], straight_slew(PROBLEMS["none"]), tmp_path / "plan.pdf")
    assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")
    assert dict(mpl.rcParams) == before
    for module in (plots, sphere_view):
        assert "pyplot" not in inspect.getsource(module)


@pytest.mark.parametrize("point", [(0.0, 0.0), (0.0, 1.0), (-0.9, 0.3), (0.5, -0.5)])
def test_a_name_stands_inside_the_rim_and_clear_of_what_is_drawn(point):
    point = np.array(point)
    along = np.linspace(-1.0, 1.0, 101)[:, None]
    for direction in ([1.0, 0.0], [0.0, 1.0], [0.6, 0.8]):
        drawn = point + along * direction  # a line through the very point that is named
        place = name_place(point, drawn)
        assert np.linalg.norm(place) < 0.95
        assert np.linalg.norm(drawn - place, axis=1).min() > 0.05  # half a letter's height
        assert np.linalg.norm(place - point) < 0.2
