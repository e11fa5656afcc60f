"""Advice on a log of roadlog's own, put into the words of the profile that made it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from roadlog.checks import Finding
from roadlog.errors import ConfigError
from roadlog.ingest.mount import through
from roadlog.ingest.profile import Profile


def advised(found: Sequence[Finding], record: Mapping[str, str]) -> list[Finding]:
    """Findings with their advice on mounts as one for the profile in a log's record."""
    if not record or not any("mount = {" in str(finding) for finding in found):
        return list(found)
    try:
        mount = Profile.from_toml(record["toml"], "own").mounts["imu"]
    except (KeyError, ConfigError):
        return list(found)
    return [
        replace(f, found=through(f.found, mount), advice=through(f.advice, mount)) for f in found
    ]
