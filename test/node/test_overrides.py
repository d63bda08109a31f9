# SPDX-License-Identifier: Apache-2.0
"""Parameter files of which no section is for the node."""

from pathlib import Path

import pytest

from riem_planner.node.overrides import inapplicable

CONFIG = Path(__file__).resolve().parents[2] / "config"


def _sentence(tmp_path, text, name):
    path = tmp_path / "given.yaml"
    path.write_text(text)
    return inapplicable(["node", "--ros-args", "--params-file", str(path)], name)


@pytest.mark.parametrize(
    ("section", "name", "applies"),
    [
        ("/**", "/sat1/att", True),
        ("/**/att", "/sat1/att", True),
        ("/**/att", "/att", True),
        ("/**/att", "/sat1/other", False),
        ("/*/att", "/sat1/att", True),
        ("/*/att", "/a/b/att", False),
        ("/sat1/att", "/sat1/att", True),
        ("riem_planner", "/riem_planner", True),
        ("/riem_planner", "/sat1/riem_planner", False),
    ],
)
def test_a_section_applies_as_rcl_has_it(tmp_path, section, name, applies):
    sentence = _sentence(tmp_path, f"{section}: {{ros__parameters: {{duration: 5.0}}}}", name)
    assert (sentence == "") is applies
    if not applies:
        assert "given.yaml" in sentence
        assert name in sentence
        assert section in sentence


def test_nested_namespaces_and_several_sections(tmp_path):
    text = "/sat1: {att: {ros__parameters: {}}}\n/other: {ros__parameters: {}}"
    assert _sentence(tmp_path, text, "/sat1/att") == ""
    assert "/sat1/att, /other" in _sentence(tmp_path, text, "/sat2/att")


def test_no_file_is_no_mistake_and_the_shipped_ones_apply_to_every_name():
    assert inapplicable(["node"], "/a/b") == ""
    for name in ("planner.yaml", "demo.yaml"):
        arguments = ["--params-file", str(CONFIG / name)]
        assert inapplicable(arguments, "/sat1/att") == ""
