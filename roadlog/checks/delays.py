"""Delays of a profile that no sensor has."""

from __future__ import annotations

from collections.abc import Mapping

from roadlog.checks.finding import Finding

MAX_DELAY = 2.0  # s; filters, buses and receivers together are not later


def delays(stated: Mapping[str, float]) -> list[Finding]:
    """A finding for each delay [s] that cannot be one. stated: role -> delay."""
    roles: dict[float, list[str]] = {}
    for role, delay in stated.items():
        if abs(delay) > MAX_DELAY:
            roles.setdefault(delay, []).append(role)
    return [
        Finding(
            "delay",
            "fault",
            tuple(names),
            f"is moved by a delay of {delay:g} s, and no sensor is later than {MAX_DELAY:g} s",
            f'milliseconds? Then say delay = "{delay:g} ms"; another device\'s clock is what '
            "`ingest --time-offset` sets",
            value=delay,
        )
        for delay, names in roles.items()
    ]
