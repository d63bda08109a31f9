# SPDX-License-Identifier: Apache-2.0
"""Packages of extras: imported where they are used, asked for by name where they are missing."""

from __future__ import annotations

import importlib.util

from riem_planner.errors import InvalidProblemError

_EXTRA_OF = {"pyarrow": "surveys", "distributed": "surveys", "spiceypy": "ck"}


def require(*modules: str) -> None:
    """Raise unless the modules are installed.

    Raises
    ------
    InvalidProblemError
        One is missing; the error says how to install it.
    """
    for module in modules:
        if importlib.util.find_spec(module) is None:
            extra = _EXTRA_OF[module]
            raise InvalidProblemError(
                module, f"not installed; pip install 'riem_planner[{extra}]' brings it"
            )
