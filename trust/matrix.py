# SPDX-License-Identifier: Apache-2.0
"""The matrix of requirements: every one is verified by tests that exist and pass, and none is lost.

`python -m trust.matrix` fails on an orphan; `--run` also runs the tests that verify.
"""

from __future__ import annotations

import argparse
import ast
import csv
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MATRIX = ROOT / "docs/trust/requirements.csv"
PLANS = ROOT / "docs/trust/npr7150.md"
CLASS_C = 88
"""Numbers of NPR 7150.2D that hold for class C."""
COLUMNS = ["id", "text", "parent", "verified_by", "npr"]


def rows() -> list[dict[str, str]]:
    """The requirements."""
    with MATRIX.open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        found = list(reader)
    if list(reader.fieldnames or ()) != COLUMNS:
        raise SystemExit(f"{MATRIX}: expected the columns {', '.join(COLUMNS)}")
    return found


def tests_of(row: dict[str, str]) -> list[str]:
    """Node ids of the tests that verify a requirement."""
    return row["verified_by"].split()


def marked() -> dict[str, set[str]]:
    """Ids that tests say they verify, by the test's node id without parameters."""
    found: dict[str, set[str]] = {}
    for path in sorted((ROOT / "test").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            for decorator in node.decorator_list:
                call = decorator if isinstance(decorator, ast.Call) else None
                name = ast.unparse(call.func if call else decorator)
                if name.endswith("mark.requirement"):
                    ids = {ast.literal_eval(arg) for arg in call.args} if call else {""}
                    found[f"{path.relative_to(ROOT)}::{node.name}"] = ids
    return found


def defined() -> set[str]:
    """Node ids, without parameters, of the test functions that there are."""
    found = set()
    for path in sorted((ROOT / "test").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                found.add(f"{path.relative_to(ROOT)}::{node.name}")
    return found


def problems() -> list[str]:
    """What is wrong with the matrix; empty if nothing is."""
    found = []
    requirements, there, claims = rows(), defined(), marked()
    ids = [row["id"] for row in requirements]
    numbers = npr_numbers()
    found += [f"{name}: stands twice" for name in ids if ids.count(name) > 1]
    for row in requirements:
        name = row["id"]
        if not re.fullmatch(r"RP-\d{3}", name):
            found.append(f"{name}: expected an id like RP-001")
        if row["parent"] and row["parent"] not in ids:
            found.append(f"{name}: its parent {row['parent']} is no requirement")
        if not tests_of(row):
            found.append(f"{name}: no test verifies it")
        found += [f"{name}: there is no test {test}" for test in tests_of(row) if test not in there]
        unknown = [n for n in row["npr"].split() if n not in numbers]
        found += [f"{name}: NPR {number} is none of class C" for number in unknown]
    verified = {(row["id"], test) for row in requirements for test in tests_of(row)}
    for test, names in claims.items():
        found += [f"{test}: says that it verifies {name or 'nothing'}, which the matrix does not"
                  for name in names if (name, test) not in verified]  # fmt: skip
    if len(numbers) != CLASS_C or len(set(numbers)) != CLASS_C:
        found.append(f"{PLANS.name}: expected {CLASS_C} numbers, each once, got {len(numbers)}")
    return found


def npr_numbers() -> list[str]:
    """Section numbers of NPR 7150.2D that have a row."""
    return re.findall(r"^\| (\d+\.\d+\.\d+) \|", PLANS.read_text(encoding="utf-8"), re.MULTILINE)


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", action="store_true", help="run the tests that verify")
    options = parser.parse_args()
    found = problems()
    for problem in found:
        print(problem)
    if found:
        return 1
    requirements = rows()
    tests = sorted({test for row in requirements for test in tests_of(row)})
    print(f"{len(requirements)} requirements, verified by {len(tests)} tests; no orphans")
    if not options.run:
        return 0
    command = [sys.executable, "-m", "pytest", "-q", *tests]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
