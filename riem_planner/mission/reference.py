# SPDX-License-Identifier: Apache-2.0
"""Pages that are made from what the code declares: parameters, status codes, phases.

    python -m riem_planner.mission.reference

writes `config/planner.yaml`, `docs/parameters.md`, and the tables and the diagram of
`docs/node.md`, in the present folder; a test compares.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from riem_planner.mission.codes import Code
from riem_planner.mission.phases import Happening, Phase, diagram
from riem_planner.mission.settings import (
    BODY_SPECIFICATIONS,
    SPECIFICATIONS,
    ZONE_SPECIFICATIONS,
    Specification,
)

_WHEN = {"any time": "", "unconfigured": "(*) ", "never": "(**) "}
_GROUPS = {
    "space": "What is planned, and in which frames",
    "duration": "The slew, and what the spacecraft can do",
    "normalized_tension": "What is kept away from",
    "start.orientation": "Where it begins, and where it goes at first",
    "setpoint_rate": "The stream, and planning beside it",
    "autostart": "The life of the node",
    "zone_names": "Zones",
}
_HEAD = """\
# Every parameter of planner_node with its default; made by python -m riem_planner.mission.reference
# from riem_planner/mission/settings.py. Numbers of kind double need a decimal point. An empty list
# means unset. Parameters marked (*) may be set only while the node is unconfigured, those marked
# (**) only at the start; all others at any time, and what flies is then checked anew.
#
#   planner_node --ros-args --params-file config/planner.yaml

/**:
  ros__parameters:
"""
_QOS = """
    # QoS of every topic may be set at the start, of outputs deadline, lifespan and liveliness too.
    # A controller that wants to be told when a setpoint is more than 0.1 s late [ns]:
    #
    # qos_overrides./riem_planner/setpoint.publisher.deadline: 100000000
"""
_WIDTH = 40


def _value(default: object) -> str:
    if default is None:
        return "[]"
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, str):
        return default or '""'
    return str(default)


def _line(indent: str, name: str, item: Specification) -> str:
    given = f"{indent}{name}: {_value(item.default)}"
    return f"{given:<{_WIDTH - 1}} # {_WHEN[item.change]}{item.description}"


def planner_yaml() -> str:
    """The text of `config/planner.yaml`."""
    lines = []
    for item in SPECIFICATIONS:
        if item.name in _GROUPS:
            lines += ["", f"    # {_GROUPS[item.name]}"]
        lines.append(_line("    ", item.name, item))
    lines += ["", "    # A zone called sun, zone_names: [sun], has:", "    #"]
    lines += [_line("    # ", f"zones.sun.{item.name}", item) for item in ZONE_SPECIFICATIONS]
    lines += [
        "    #",
        "    # and leaves the last four to its body, if it has one called sun:",
        "    #",
    ]
    lines += [_line("    # ", f"bodies.sun.{item.name}", item) for item in BODY_SPECIFICATIONS]
    return _HEAD + "\n".join(lines).lstrip("\n") + "\n" + _QOS


def _rows(items: Iterable[Specification], prefix: str = "") -> list[str]:
    changes = {
        "any time": "any time",
        "unconfigured": "while unconfigured",
        "never": "at the start",
    }
    rows = ["| parameter | default | meaning | may be set |", "|---|---|---|---|"]
    for item in items:
        meaning = item.description.replace("|", "\\|")
        if item.choices:
            meaning += f"; one of {', '.join(item.choices)}"
        if item.kind in ("number", "integer") or item.lengths:
            meaning += f"; {_range(item)}" if _range(item) else ""
        default = "unset" if item.default in (None, [], "") else f"`{_value(item.default)}`"
        change = changes.get(item.change, item.change)
        rows.append(f"| `{prefix}{item.name}` | {default} | {meaning} | {change} |")
    return rows


def _range(item: Specification) -> str:
    if item.least <= -1e9 and item.most >= 1e9:
        return ""
    return f"{item.least:g} to {item.most:g}"


def parameters_page() -> str:
    """The text of `docs/parameters.md`."""
    parts = ["# Parameters of `planner_node`", ""]
    parts += [
        "Made by `python -m riem_planner.mission.reference` from the one table that the node",
        "declares them by. A value out of range is refused with its name; setting a parameter to",
        "the value that it has always succeeds, so a dump loads in every state. Lists are unset by",
        "`[]`.",
        "",
    ]
    parts += _rows(SPECIFICATIONS)
    parts += ["", "## Of each zone in `zone_names`", ""]
    parts += _rows(ZONE_SPECIFICATIONS, "zones.<name>.")
    parts += ["", "## Of each body that a zone names", ""]
    parts += _rows(BODY_SPECIFICATIONS, "bodies.<name>.")
    return "\n".join(parts) + "\n"


def codes_table() -> str:
    """The table of status codes."""
    rows = ["| code | level | end | when, or what to do |", "|---|---|---|---|"]
    for code in Code:
        end = "yes" if code.ends else ""
        rows.append(f"| `{code.name}` | {code.level.name} | {end} | {code.sentence} |")
    return "\n".join(rows) + "\n"


def phases_section() -> str:
    """The diagram of what is flown, and what its words mean."""
    rows = ["```text", *diagram().splitlines(), "```", "", "| word | meaning |", "|---|---|"]
    words: list[Phase | Happening] = [*Phase, *Happening]
    rows += [f"| `{word.name}` | {word.value} |" for word in words]
    return "\n".join(rows) + "\n"


def inserted(page: str, name: str, text: str) -> str:
    """A page with a text between its marks `<!-- name -->` and `<!-- end -->`."""
    begin = f"<!-- {name} -->\n"
    before, _, rest = page.partition(begin)
    _, end, after = rest.partition("<!-- end -->")
    return before + begin + text + end + after


def node_page(page: str) -> str:
    """The page of the node with what is made from the code brought up to date."""
    return inserted(inserted(page, "codes", codes_table()), "phases", phases_section())


def main() -> None:
    """Write the pages."""
    Path("config/planner.yaml").write_text(planner_yaml(), encoding="utf-8")
    Path("docs/parameters.md").write_text(parameters_page(), encoding="utf-8")
    page = Path("docs/node.md")
    if page.is_file():
        page.write_text(node_page(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
