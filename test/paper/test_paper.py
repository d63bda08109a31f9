# SPDX-License-Identifier: Apache-2.0
"""What the paper claims about its curves, measured; and the command that draws them."""

import csv

import numpy as np
import pytest

from riem_planner import solve
from riem_planner.geometry import sphere
from riem_planner.paper import figures, paper


def deviation(curve, free):
    return float(np.max(sphere.angle(curve.points, free.points)))


@pytest.fixture(scope="module")
def free():
    return paper.planned(paper.boundary_value_problem(paper.CUBIC))


@pytest.fixture(scope="module")
def avoiding():
    strengths = (1.0, 10.0, 50.0, 200.0, 400.0)
    return {t: paper.planned(paper.boundary_value_problem(paper.CUBIC, t)) for t in strengths}


def test_boundary_value_curve_without_obstacle_is_the_paper_cubic(free):
    literal = paper.paper_literal(paper.CUBIC, 0.0)
    points = np.stack([np.interp(free.times, literal.times, x) for x in literal.points.T], axis=1)
    assert np.max(sphere.angle(points, free.points)) < 2e-3  # the error of Euler's method


def test_weak_avoidance_curve_is_close_to_the_cubic_everywhere(free, avoiding):
    """At tau = 1 within 0.1 rad of the cubic all along, of a path of 2.4 rad."""
    assert 0.05 < deviation(avoiding[1.0], free) < 0.1
    assert avoiding[1.0].distance(avoiding_obstacle()) > 0.08


def avoiding_obstacle():
    return paper.boundary_value_problem(paper.CUBIC, 1.0).obstacles[0].direction


def test_deformation_and_clearance_grow_with_the_strength(free, avoiding):
    deviations = [deviation(curve, free) for curve in avoiding.values()]
    distances = [curve.distance(avoiding_obstacle()) for curve in avoiding.values()]
    assert deviations == sorted(deviations)
    assert distances == sorted(distances)
    assert deviations[-1] > 5.0 * deviations[0]


def test_deformation_grows_with_the_strength_as_the_paper_computes_it():
    _, lift = paper.paper_obstacle(paper.CUBIC)
    free = paper.paper_literal(paper.CUBIC, 0.0)
    deviations = [
        deviation(paper.paper_literal(paper.CUBIC, tau, lift), free) for tau in (1, 50, 200, 400)
    ]
    assert deviations == sorted(deviations)
    assert deviations[0] < 0.01


def test_boundary_value_curves_keep_off_where_the_paper_literal_ones_do_not(avoiding):
    place, lift = paper.paper_obstacle(paper.CUBIC)
    for tau in (1.0, 50.0, 200.0, 400.0):
        literal = paper.paper_literal(paper.CUBIC, tau, lift).chord_distance(place)
        assert avoiding[tau].chord_distance(avoiding_obstacle()) > 20.0 * literal
        certificate = solve(paper.boundary_value_problem(paper.CUBIC, tau)).certificate
        assert 0.0 < certificate.clearance["q"] <= avoiding[tau].distance(avoiding_obstacle())


@pytest.mark.parametrize(("strength", "cheaper"), [(1.0, 11.927488), (1.2, 12.821985)])
def test_own_problem_of_figure_2_is_solved_to_its_cheaper_side(strength, cheaper):
    solution = solve(paper.boundary_value_problem(paper.CUBIC, strength))
    assert solution.cost == pytest.approx(cheaper, abs=1e-6)
    assert solution.converged
    assert solution.alternatives[0].cost > solution.cost


def test_figures_say_their_data_and_the_table_has_chords_alone():
    for picture in figures.PICTURES:
        text = figures._data(picture)
        assert all(word in text for word in ("v(0) = (0,", "$t_q$ =", "T =", "h = 1 ms", "chosen"))
    assert not any("rad" in heading or "angle" in heading for heading in figures._HEADINGS)


def test_corrected_initial_values_are_followed_until_they_are_thrown_off():
    curve = paper.corrected(paper.CUBIC, 50.0, avoiding_obstacle())
    assert 0.3 < curve.ends < 0.6
    assert curve.times[-1] == curve.ends
    assert paper.corrected(paper.CUBIC, 0.0).ends == np.inf


def test_command_writes_figures_and_tables(tmp_path, capsys):
    assert figures.main(["--output", str(tmp_path / "new"), "--dpi", "40"]) == 0
    written = {path.name for path in (tmp_path / "new").iterdir()}
    assert written == {
        "figure1.png", "figure2.png", "figure3.png", "problem.png", "table.csv", "table.md",
    }  # fmt: skip
    assert all(path.stat().st_size > 500 for path in (tmp_path / "new").iterdir())
    with (tmp_path / "new" / "table.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    literal = [row for row in rows if row["method"] == "paper literal"]
    assert len(literal) == 7
    for row in literal:
        assert row["least chord"] == row["reference"]
    text = (tmp_path / "new" / "table.md").read_text(encoding="utf-8")
    assert {line.count("|") for line in text.splitlines() if line.startswith("|")} == {8}
    assert "2.54e-06" in text
    assert "1.255e-06" in text
    assert "wrote figure1.png" in capsys.readouterr().out


def test_command_says_where_it_cannot_write(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert figures.main(["--output", str(tmp_path / "file")]) == 2
    assert "cannot write" in capsys.readouterr().err
