# SPDX-License-Identifier: Apache-2.0
"""The matrix of requirements is whole, and an orphan would be found."""

import importlib.metadata

import pytest

from trust import matrix, sbom


@pytest.mark.requirement("RP-033")
def test_the_matrix_has_no_orphan():
    assert matrix.problems() == []


@pytest.mark.requirement("RP-033")
def test_an_orphan_is_found(tmp_path, monkeypatch):
    text = matrix.MATRIX.read_text(encoding="utf-8")
    spoiled = (
        text.replace("RP-011", "RP-010", 1),
        text.replace("test_limits_are_judged_at_all_times", "test_that_is_not_there"),
        text.replace(",RP-001,", ",RP-999,", 1),
        text.replace(",3.6.1\n", ",9.9.9\n", 1),
        text + 'RP-099,"Nothing verifies this.",,,\n',
    )
    for case in spoiled:
        path = tmp_path / "requirements.csv"
        path.write_text(case, encoding="utf-8")
        monkeypatch.setattr(matrix, "MATRIX", path)
        assert case != text
        assert matrix.problems()


def test_a_missing_number_of_class_c_is_found(tmp_path, monkeypatch):
    path = tmp_path / "npr7150.md"
    text = matrix.PLANS.read_text(encoding="utf-8")
    path.write_text(text.replace("| 3.7.1 |", "| - |"), encoding="utf-8")
    monkeypatch.setattr(matrix, "PLANS", path)
    assert any("88" in problem for problem in matrix.problems())


@pytest.mark.requirement("RP-034")
def test_the_bill_lists_what_is_installed():
    bill = sbom.document()
    assert bill["bomFormat"] == "CycloneDX"
    listed = {entry["name"].lower(): entry["version"] for entry in bill["components"]}
    for name in ("numpy", "scipy", "numba"):
        assert listed[name] == importlib.metadata.version(name)
    assert "riem_planner" not in listed
