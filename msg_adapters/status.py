# SPDX-License-Identifier: Apache-2.0
"""Diagnostic messages: what happened, with names and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters.geometry import SECOND, header

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE


def stamp_text(nanoseconds: int) -> str:
    """A time as ~/status tells it: seconds, a point, nine digits."""
    seconds, rest = divmod(nanoseconds, SECOND)
    return f"{seconds}.{rest:09d}"


def text_of(value: object) -> str:
    """A value as people read it: six digits of a number."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def status_from_report(
    level: bytes, name: str, message: str, values: Mapping[str, object], hardware: str
) -> DiagnosticStatus:
    """Status message of an outcome; `values` in the order given."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=text_of(value)) for key, value in values.items()],
    )


def report_from_status(message: DiagnosticStatus) -> tuple[bytes, str, dict[str, str]]:
    """Level, message and values of a status."""
    return message.level, message.message, {item.key: item.value for item in message.values}


def diagnostics(statuses: Sequence[DiagnosticStatus], nanoseconds: int) -> DiagnosticArray:
    """Message for /diagnostics."""
    return DiagnosticArray(header=header(nanoseconds, ""), status=list(statuses))
