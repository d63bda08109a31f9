# SPDX-License-Identifier: Apache-2.0
"""Do the tests see errors? Each comparison, sign and constant of a file is changed, one at a time.

`python -m trust.mutation FILE --test TEST [--most N] [--seed S]` copies nothing and changes no
file: a mutant is put in the place of the module in a process of its own, which then runs the tests.
It prints the survivors and the share that some test killed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT = 300.0
"""Time after which a mutant that makes the tests hang counts as killed [s]."""
_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
_SIGNS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
# Run by pytest before all else: the module is loaded from the mutant's text.
_PLUGIN = """
import importlib.abc, importlib.util, os, sys

class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["MUTANT_MODULE"]:
            return importlib.util.spec_from_file_location(name, os.environ["MUTANT_FILE"])
        return None

sys.meta_path.insert(0, Finder())
"""


def mutants(source: str) -> Iterator[tuple[str, str]]:
    """Texts with one change each, and what it is."""
    tree = ast.parse(source)
    for index, node in enumerate(_places(tree)):
        for change in _changes(node):
            other = copy.deepcopy(tree)
            twin = _places(other)[index]
            before = ast.unparse(twin)
            change(twin)
            yield ast.unparse(other), f"line {twin.lineno}: {before}  ->  {ast.unparse(twin)}"


def _places(tree: ast.Module) -> list[Any]:
    """Nodes that can be changed, always in the same order."""
    kinds = ast.Compare | ast.BinOp | ast.UnaryOp | ast.Constant
    return [node for node in ast.walk(tree) if isinstance(node, kinds)]


def _changes(node: Any) -> Iterator[Callable[[Any], None]]:
    """What can be done to a node."""
    if isinstance(node, ast.Compare):
        for i, operator in enumerate(node.ops):
            other = _COMPARISONS[type(operator)]()
            yield lambda twin, i=i, other=other: twin.ops.__setitem__(i, other)
    elif isinstance(node, ast.BinOp) and type(node.op) in _SIGNS:
        sign = _SIGNS[type(node.op)]()
        yield lambda twin: setattr(twin, "op", sign)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield lambda twin: setattr(twin, "op", ast.UAdd())
    elif isinstance(node, ast.Constant) and type(node.value) is int:
        yield lambda twin: setattr(twin, "value", twin.value + 1)


def killed(text: str, module: str, tests: list[str], folder: Path) -> bool:
    """Whether some test fails, or never ends, with a mutant in the module's place."""
    # By its own name, which tests may ask for.
    mutant = folder / (module.rpartition(".")[2] + ".py")
    mutant.write_text(text, encoding="utf-8")
    (folder / "mutant_plugin.py").write_text(_PLUGIN, encoding="utf-8")
    environment = os.environ | {
        "MUTANT_MODULE": module,
        "MUTANT_FILE": str(mutant),
        "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)]),
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--noconftest", "-p", "mutant_plugin",
               "-p", "no:cacheprovider", *tests]  # fmt: skip
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--test", action="append", required=True)
    parser.add_argument("--most", type=int, default=10**9, help="mutants that are tried")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    module = ".".join(options.file.with_suffix("").parts)
    source = (ROOT / options.file).read_text(encoding="utf-8")
    found = list(mutants(source))
    random.Random(options.seed).shuffle(found)
    tried, dead = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        if killed(source, module, options.test, Path(folder)):
            print("the tests fail without any change")
            return 2
        for text, what in found[: options.most]:
            tried += 1
            if killed(text, module, options.test, Path(folder)):
                dead += 1
            else:
                print(f"survived: {what}", flush=True)
    share = 100.0 * dead / max(tried, 1)
    print(f"{options.file}: {dead} of {tried} killed, {share:.1f} % (of {len(found)} mutants)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
