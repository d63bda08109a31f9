# SPDX-License-Identifier: Apache-2.0
"""Evidence in one file: `python -m trust.dossier OUT.zip`.

Matrix, declaration, security policy, the proofs of the published manoeuvres, the bill of materials,
the reports of tests and mutation where they were written to build/, and the commit.
"""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

from trust import sbom

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "docs/trust/requirements.csv",
    "docs/trust/npr7150.md",
    "docs/proof.md",
    "docs/monitor.md",
    "QUALITY_DECLARATION.md",
    "SECURITY.md",
    "LICENSE",
    "CHANGELOG.rst",
    "config/security/policy.xml",
)
REPORTS = ("tests.xml", "coverage.xml", "mutation.txt")
"""Of `build/`, put in where they are."""


def proofs() -> str:
    """A line for each published manoeuvre: its name and what the checker says of its plan."""
    from riem_planner.files.plan_files import encoded, plan_document
    from riem_planner.files.problem_files import read_problem
    from riem_planner.files.problem_writing import problem_document
    from riem_planner.proof import check
    from riem_planner.riem_plan.planning import plan_problem

    lines = []
    for path in sorted((ROOT / "config/problems").glob("*.yaml")):
        stated = read_problem(path)
        plan = encoded(plan_document(plan_problem(stated)))
        try:
            told = "proven " + check.examine(json.dumps(problem_document(stated)), plan)
        except check.Verdict as found:
            told = " ".join(found.args)
        lines.append(f"{path.stem}: {told}\n")
    return "".join(lines)


def main() -> int:
    """Run the command; code 1 where a published manoeuvre is not proven."""
    if len(sys.argv) != 2:
        print("usage: python -m trust.dossier OUT.zip")
        return 2
    told = proofs()
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    with zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as archive:
        for name in PAGES:
            archive.write(ROOT / name, name)
        for name in REPORTS:
            if (ROOT / "build" / name).is_file():
                archive.write(ROOT / "build" / name, f"reports/{name}")
        archive.writestr("reports/proofs.txt", told)
        archive.writestr("reports/sbom.json", json.dumps(sbom.document(), indent=1))
        archive.writestr("reports/commit.txt", commit)
    print(told, end="")
    return 0 if all(": proven " in line for line in told.splitlines()) else 1


if __name__ == "__main__":
    sys.exit(main())
