# SPDX-License-Identifier: Apache-2.0
"""Check the Python of the README and the docs: every block passes mypy --strict, and runs.

    python docs/check_python.py [PAGE ...]

The blocks of a page marked `python` are one program, which is run. One marked `py` is a program of
its own that waits for others, such as a client of the node: its types are checked.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```(python|py)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def programs(pages: list[Path], folder: Path) -> dict[Path, tuple[str, bool]]:
    """Write the programs of the pages; each file with its page, and whether it is to be run."""
    written = {}
    for page in pages:
        blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
        name = str(page.relative_to(ROOT).with_suffix("")).replace("/", "_").replace("-", "_")
        together = "\n".join(text for kind, text in blocks if kind == "python")
        apart = [text for kind, text in blocks if kind == "py"]
        for number, text in enumerate(filter(None, [together, *apart])):
            program = folder / f"page_{name}_{number}.py"
            program.write_text(text, encoding="utf-8")
            written[program] = (str(page.relative_to(ROOT)), text is together)
    return written


def main(names: list[str]) -> int:
    """Check the pages named, or all of them; the exit code."""
    pages = [Path(name).resolve() for name in names] or [
        ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")),
    ]  # fmt: skip
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        written = programs(pages, Path(folder))
        typed = subprocess.run(
            [sys.executable, "-m", "mypy", "--strict", "--config-file", "pyproject.toml",
             *map(str, written)],
            cwd=ROOT, check=False,
        )  # fmt: skip
        failed |= typed.returncode != 0
        for program, (page, runs) in written.items():
            if not runs:
                continue
            done = subprocess.run(
                [sys.executable, program], cwd=ROOT, capture_output=True, text=True, check=False,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
            )  # fmt: skip
            if done.returncode != 0:
                failed = True
                print(f"{page}: its Python fails\n{done.stderr}", file=sys.stderr)
    print(f"{len(written)} programs in the docs" + (", FAILED" if failed else ": all pass"))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
