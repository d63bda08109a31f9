# SPDX-License-Identifier: Apache-2.0
"""Text to plain values: YAML of the 1.2 core schema, and JSON, with duplicate keys kept track of.

YAML 1.1, which most parsers speak, reads `1e-3` as text, `1:30` as ninety and `no` as false.
Here a number is what looks like one, and only `true` and `false` are booleans. Its merge keys
(`<<: *anchor`) are understood: keys of the mapping itself count more than merged ones.
"""

from __future__ import annotations

import json
import re
from typing import Any

import yaml

from riem_planner.errors import InvalidProblemError


class Mapping(dict[str, Any]):
    """A mapping of a document, which remembers keys that it held more than once."""

    def __init__(self, pairs: list[tuple[Any, Any]]) -> None:
        super().__init__(pairs)
        keys = [key for key, _ in pairs]
        self.duplicates = sorted({str(key) for key in keys if keys.count(key) > 1})


class _CoreLoader(yaml.SafeLoader):
    """YAML with the scalars of the 1.2 core schema."""

    yaml_implicit_resolvers = {}  # noqa: RUF012 (declared by the base class)


_SCALARS = (
    ("tag:yaml.org,2002:null", r"~|null|Null|NULL|", "~nN"),
    ("tag:yaml.org,2002:bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("tag:riem_planner:int", r"[-+]?[0-9]+", "-+0123456789"),
    (
        "tag:riem_planner:float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
)
for _tag, _pattern, _first in _SCALARS:
    _CoreLoader.add_implicit_resolver(_tag, re.compile(f"^(?:{_pattern})$"), [*_first])
_CoreLoader.add_implicit_resolver("tag:yaml.org,2002:null", re.compile("^$"), [""])


def _construct_mapping(loader: _CoreLoader, node: yaml.MappingNode) -> Mapping:
    pairs = []
    merged: dict[str, Any] = {}
    for key_node, value_node in node.value:
        if isinstance(key_node, yaml.ScalarNode) and _is_merge(key_node):
            # Of several the first one counts (YAML's type repository), so the last goes first.
            for source in reversed(_merge_sources(loader, value_node)):
                merged |= source
            continue
        if not isinstance(key_node, yaml.ScalarNode):
            raise yaml.constructor.ConstructorError(
                None, None, "a key must be a word", key_node.start_mark
            )
        pairs.append((key_node.value, loader.construct_object(value_node, deep=True)))
    own = {key for key, _ in pairs}
    return Mapping([(key, value) for key, value in merged.items() if key not in own] + pairs)


def _is_merge(node: yaml.ScalarNode) -> bool:
    return node.value == "<<" and node.style is None


def _merge_sources(loader: _CoreLoader, node: yaml.Node) -> list[Mapping]:
    """The mappings that a merge key `<<` names: one, or a list of them."""
    value = loader.construct_object(node, deep=True)
    sources = value if isinstance(value, list) else [value]
    if not all(isinstance(source, Mapping) for source in sources):
        raise yaml.constructor.ConstructorError(
            None, None, "<< expects a mapping, or a list of mappings", node.start_mark
        )
    return sources


def _construct_float(loader: _CoreLoader, node: yaml.ScalarNode) -> float:
    return float(node.value.lower().replace(".inf", "inf").replace(".nan", "nan"))


_CoreLoader.add_constructor("tag:yaml.org,2002:map", _construct_mapping)
_CoreLoader.add_constructor("tag:riem_planner:int", lambda _, node: int(node.value))
_CoreLoader.add_constructor("tag:riem_planner:float", _construct_float)


def decoded(content: bytes) -> str:
    """Text of a file or a line in UTF-8, with or without a byte order mark.

    Raises
    ------
    InvalidProblemError
        It is something else.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidProblemError("document", f"expected UTF-8 text: {error}") from None


def parse_yaml(text: str) -> Any:
    """Value of a YAML document; mappings are `Mapping`.

    Raises
    ------
    InvalidProblemError
        The text is not YAML; the error's key is the place.
    """
    try:
        return yaml.load(text, Loader=_CoreLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else "document"
        raise InvalidProblemError(place, f"not YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InvalidProblemError("document", f"not YAML: {error}") from None


def parse_json(text: str) -> Any:
    """Value of a JSON document; mappings are `Mapping`.

    Raises
    ------
    InvalidProblemError
        The text is not JSON; the error's key is the place.
    """
    try:
        return json.loads(text, object_pairs_hook=Mapping)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InvalidProblemError(place, f"not JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise InvalidProblemError("document", f"not JSON: {error}") from None
