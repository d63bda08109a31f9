# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmark`: the tables of `make bench`. See `python -m benchmark --help`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmark import cases, comparison, own, random_cases
from benchmark.flights import flights
from benchmark.folder import case_files
from benchmark.hard import Outcome, hard, run
from benchmark.least_time import least_time
from benchmark.peers import shooting
from benchmark.report import Table, write
from benchmark.startup import startup
from riem_planner import warm_up

RESULTS = Path(__file__).parent

KINDS_OF_SET = {"random-so3": "so3", "random-s2": "s2", "random-cones": "cones"}


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmark", description=__doc__)
    parser.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=("all", "hard", "random", "flights", "node", "cases", "least-time"),
        help="all: beside the peers, and the planner's own figures; hard: the hard sets;"
        " cases: a folder of case files;"
        " random: new problems like those of the case files; flights: the published manoeuvres;"
        " node: the node in operation (16 min); least-time: one slew, quick and smooth",
    )
    parser.add_argument("--quick", action="store_true", help="a few problems, once each")
    parser.add_argument("--count", type=int, default=300, help="problems of each hard set")
    parser.add_argument("--set", action="append", help="only this hard set (may be repeated)")
    parser.add_argument("--seed", type=int, default=1, help="of the new random problems")
    parser.add_argument("--failures", type=Path, help="folder for failing cases, one file a set")
    parser.add_argument("--cases", type=Path, default=cases.DATA, help="folder of case files")
    parser.add_argument("--verbose", action="store_true", help="cases: what misses the bars too")
    parser.add_argument("--output", type=Path, default=RESULTS, help="folder for the results")
    return parser.parse_args(arguments)


def _first(count: int) -> list[cases.Case]:
    """The first `count` problems of the random sets together, in turn."""
    sets = [cases.load(name) for name in KINDS_OF_SET]
    return [sets[i % 3][i // 3] for i in range(count)]


def _all(quick: bool) -> list[Table]:
    sets = {name: cases.load(name) for name in cases.SETS}
    if quick:
        sets = {name: loaded[:2] for name, loaded in sets.items()}
    random = _first(3 if quick else 20)
    rounds = 1 if quick else 25
    # Compiling takes IPOPT 10 to 20 s a structure, so it is done for those of the textbook.
    textbook = [cases.problem_of(case) for case in sets["textbook"]]
    structures = set() if quick else {shooting.structure(problem) for problem in textbook}
    return [
        comparison.comparison("textbook", sets["textbook"], rounds, structures),
        comparison.comparison("random", random, rounds if quick else 10, structures),
        own.speed(sets, 1 if quick else 5),
        own.warm([c for name in KINDS_OF_SET for c in sets[name]], 1 if quick else 5),
        own.scaling((1, 5) if quick else (1, 5, 20, 50), 2 if quick else 40, 1 if quick else 5),
        own.throughput(sets["random-so3"], 1 if quick else 5),
        startup(compile_anew=not quick, repeats=1 if quick else 3),
    ]


def _random(seed: int, count: int) -> Table:
    table = Table("New random problems", f"Seed {seed}, all classes searched.")
    for kind in KINDS_OF_SET.values():
        table.rows.append(run(random_cases.random_cases(kind, seed, count)).row(kind))
    return table


def _keep_failures(folder: Path, name: str, outcome: Outcome) -> None:
    failing = [
        {**case, "best_known_remark": remark} for case, remark in outcome.refused + outcome.wrong
    ]
    if failing:
        cases.save(failing, folder / f"{name.replace(' ', '-')}.jsonl")


def main(arguments: list[str] | None = None) -> int:
    """Measure, write the results, show them."""
    options = _arguments(sys.argv[1:] if arguments is None else arguments)
    warm_up(notify=lambda message: print(message, file=sys.stderr))
    if options.what == "all":
        tables, name = _all(options.quick), "results"
    elif options.what == "flights":
        tables, name = [flights()], "flights"
    elif options.what == "node":
        from benchmark.operation import operation  # the others do without ROS

        tables, name = operation(options.quick), "node"
    elif options.what == "least-time":
        tables, name = [least_time()], "least-time"
    elif options.what == "cases":
        tables = case_files(options.cases, options.count, options.set, options.verbose)
        name = "case-files"
    elif options.what == "random":
        tables, name = [_random(options.seed, options.count)], "random"
    else:
        folder = options.failures
        told = (lambda n, o: _keep_failures(folder, n, o)) if folder else None
        count = 2 if options.quick else options.count
        tables, name = [hard(count, options.set, told)], "hard"
    path = write(tables, options.output, name)
    print(path.read_text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
