# SPDX-License-Identifier: Apache-2.0
"""Compiled code is kept for just the sources that it was made from."""

import ast
from pathlib import Path

import riem_planner
from riem_planner.kernels import _COMPILED_ROOMS, _CONSTANTS, _IMPORT, _TOP_ROOMS

PACKAGE = Path(riem_planner.__file__).parent
DECORATORS = {"kernel", "brief_kernel", "inlined"}


def _holds_kernels(source):
    functions = (node for node in ast.walk(ast.parse(source.read_text())))
    return any(
        isinstance(node, ast.FunctionDef)
        and any(isinstance(d, ast.Name) and d.id in DECORATORS for d in node.decorator_list)
        for node in functions
    )


def test_every_file_with_kernels_counts_for_the_cache():
    rooms = (*_COMPILED_ROOMS, *(f"{room}/*.py" for room in _TOP_ROOMS))
    counted = {path for room in rooms for path in PACKAGE.glob(room)}
    holding = {path for path in PACKAGE.rglob("*.py") if _holds_kernels(path)}
    assert holding
    assert {path.name for path in holding - counted} == set()
    unread = [p for p in holding if _IMPORT not in p.read_bytes() and p.name not in _CONSTANTS]
    assert unread == []
