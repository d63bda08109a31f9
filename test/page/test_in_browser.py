# SPDX-License-Identifier: Apache-2.0
"""The page in headless Chromium, from disk and without a network: what a person sees and does."""

import os

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from test_page import HOSTILE, page_of, problem

from riem_planner import State, Zone, solve
from riem_planner.page import plan_page

# Where the page has to be tested, as in CI, a missing browser is a failure and not a skip.
_DEMANDED = os.environ.get("RIEM_PAGE_TESTS") == "required"
pytestmark = pytest.mark.skipif(
    CHROMIUM is None and not _DEMANDED, reason="there is no Chromium on this machine"
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    one = Browser(tmp_path_factory.mktemp("browser"))
    yield one
    one.close()


@pytest.fixture(scope="module")
def shown(browser, tmp_path_factory):
    """The page of a plan with an alternative, and the plan."""
    zone = Zone([0.7, 0.7, 0.1], 0.3, normalized_strength=0.01, name="sun", rate=[0, 0, 1e-3])
    goal = State.from_quaternion_xyzw([0.0, 0.0, 0.995, 0.0998749])
    text, plan = page_of(problem(obstacles=(zone,), goal=goal, name=HOSTILE))
    assert plan.solution.alternatives
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(text, encoding="utf-8")
    browser.open(path)
    return path, plan


def attitude(browser):
    return np.array(browser.value("riemPage.attitude"))


def set_time(browser, time):
    browser.value(
        f"var slider = document.querySelector('input#time'); slider.value = {time};"
        " slider.dispatchEvent(new Event('input'));"
    )


def test_it_asks_for_nothing_and_complains_of_nothing(browser, shown):
    assert browser.complaints() == []
    assert browser.value("document.title") == HOSTILE
    words = browser.value("document.body.innerText")
    least = np.degrees(shown[1].certificate.clearance["sun"])
    assert f"{least:.2f} deg" in words
    assert "Certified" in words


def test_the_view_shows_a_sphere_in_many_colours(browser, shown):
    colours = browser.value(
        "(() => { const c = document.querySelector('canvas#view'), g = c.getContext('2d');"
        " const pixels = g.getImageData(0, 0, c.width, c.height).data.buffer;"
        " return new Set(new Uint32Array(pixels)).size; })()"
    )
    assert colours >= 20
    assert browser.value("Math.min(view.canvas.clientWidth, view.canvas.clientHeight)") >= 300


@pytest.mark.parametrize("share", [0.0, 0.137, 0.5, 0.913, 1.0])
def test_between_samples_the_page_means_what_the_plan_file_means(browser, shown, share):
    trajectory = shown[1].trajectory
    set_time(browser, share * trajectory.duration)
    time = browser.value("riemPage.time")
    expected = trajectory.evaluate_quaternion(time)[0]
    assert np.abs(attitude(browser) - expected).max() < 1e-9


def test_keys_step_and_jump(browser, shown):
    duration = shown[1].trajectory.duration
    browser.key("Home")
    assert browser.value("riemPage.time") == 0.0
    browser.key("ArrowRight")
    assert browser.value("riemPage.time") == pytest.approx(duration / 200)
    browser.key("End")
    assert browser.value("riemPage.time") == pytest.approx(duration)


def test_a_click_in_a_plot_sets_the_time(browser, shown):
    for name in ("rate", "acceleration", "torque", "clearance"):
        browser.value(f"document.querySelector('[data-plot={name}]').scrollIntoView()")
        x, y = browser.value(
            f"(() => {{ const r = document.querySelector('[data-plot={name}]')"
            ".getBoundingClientRect(); return [r.left + r.width / 2, r.top + 60]; })()"
        )
        browser.key("Home")
        browser.click(x, y)
        middle = 0.5 * shown[1].trajectory.duration
        assert browser.value("riemPage.time") == pytest.approx(middle, rel=0.01)


def test_an_alternative_redraws_all(browser, shown):
    alternative = shown[1].solution.alternatives[0].trajectory
    browser.value(
        "var choice = document.querySelector('select#alternative'); choice.value = 1;"
        " choice.dispatchEvent(new Event('change'));"
    )
    assert browser.value("riemPage.alternative") == 1
    set_time(browser, 0.5 * alternative.duration)
    expected = alternative.evaluate_quaternion(browser.value("riemPage.time"))[0]
    # The alternative is shown through as many even samples as the plan has.
    assert min(np.abs(attitude(browser) - s * expected).max() for s in (1, -1)) < 1e-5
    browser.value("choice.value = 0; choice.dispatchEvent(new Event('change'));")


def test_play_runs_and_reduced_motion_only_steps(browser, shown):
    browser.key("Home")
    browser.key(" ")
    assert browser.value("riemPage.playing") is True
    browser.value("new Promise(r => setTimeout(r, 300))", wait=True)
    assert browser.value("riemPage.time") > 0.0
    browser.key(" ")
    browser.media(prefers_reduced_motion="reduce")
    browser.key("Home")
    browser.key(" ")
    assert browser.value("riemPage.playing") is False
    assert browser.value("riemPage.time") == pytest.approx(shown[1].trajectory.duration / 200)
    browser.media()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast(browser, shown, scheme):
    browser.media(prefers_color_scheme=scheme)
    worst = browser.value(
        """(() => {
          const value = style;  // the page's own reader of its colours
          const light = (colour) => rgb(colour).map((c) => c / 255)
            .map((c) => c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
            .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
          const paper = light(value("--paper"));
          return Math.min(...["--ink", "--soft", "--keep-out", "--keep-in"].map((name) => {
            const [a, b] = [light(value(name)), paper].sort((x, y) => y - x);
            return (a + 0.05) / (b + 0.05);
          }));
        })()"""
    )
    browser.media()
    assert worst >= 4.5


def test_it_prints_on_one_page(browser, shown):
    assert browser.printed_pages() == 1


def test_every_control_is_labelled(browser, shown):
    unlabelled = browser.value(
        "[...document.querySelectorAll('input, select, button, canvas')].filter((e) =>"
        " !e.getAttribute('aria-label') && !e.textContent.trim() && !e.labels?.length).length"
    )
    assert unlabelled == 0


def test_a_refused_problem_is_shown_without_complaint(browser, tmp_path):
    sun = Zone([0.7, 0.7, 0.0], 1.0, normalized_strength=0.01, name="sun")
    stated = problem(obstacles=(sun,))
    solution = solve(stated)
    path = tmp_path / "refused.html"
    path.write_text(plan_page(stated, solution), encoding="utf-8")
    browser.open(path)
    assert browser.complaints() == []
    words = browser.value("document.body.innerText")
    assert solution.message in words
    assert "sun" in words
