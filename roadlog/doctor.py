"""What this installation has: versions, extras, the compiler's cache, a display."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from roadlog.extras import PACKAGE, Requirement, requirements
from roadlog.version import __version__

NOT_FOR_USERS = ("all", "dev", "docs")  # extras: a sum of others, and what developers need


@dataclass(frozen=True)
class Finding:
    """One line of the examination. ok: None where something optional is not there."""

    topic: str
    name: str
    ok: bool | None
    found: str


def examine() -> list[Finding]:
    """Look at everything that roadlog leans on; nothing is changed and nothing is sent."""
    return [
        Finding("roadlog", "version", True, __version__),
        Finding("python", "version", sys.version_info >= (3, 11), platform.python_version()),
        Finding("python", "platform", True, platform.platform()),
        *_packages(),
        _schemas(),
        _compile_cache(),
        _display(),
    ]


def _packages() -> list[Finding]:
    """Every requirement of the installed package: the core ones must be there."""
    try:
        known = requirements()
    except metadata.PackageNotFoundError:
        return [Finding("core", PACKAGE, None, "runs from its sources and is not installed")]
    return [_package(r) for r in known if r.extra not in NOT_FOR_USERS]


def _package(needed: Requirement) -> Finding:
    topic = f"extra {needed.extra}" if needed.extra else "core"
    if version := needed.version:
        from packaging import requirements as bounds

        fits = bounds.Requirement(needed.wanted).specifier.contains(version, prereleases=True)
        hint = version if fits else f"{version}: pip install --upgrade '{needed.wanted}'"
        return Finding(topic, needed.wanted, fits, hint)
    what = f"roadlog[{needed.extra}]" if needed.extra else needed.wanted
    hint = f"missing: pip install '{what}'"
    return Finding(topic, needed.wanted, None if needed.extra else False, hint)


def _schemas() -> Finding:
    from roadlog.storage import schemas

    try:
        return Finding("log", "schemas", True, f"{len(schemas.names())} messages")
    except (OSError, ValueError) as error:
        return Finding("log", "schemas", False, f"{error}: install roadlog again")


def _compile_cache() -> Finding:
    """Compiled code is kept beside the source, or where NUMBA_CACHE_DIR says."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parent / "filters")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return Finding("compiler", "cache", True, f"{folder} can be written")
    except OSError:
        hint = "set NUMBA_CACHE_DIR to a folder that can, or every run may compile anew"
        return Finding("compiler", "cache", None, f"{folder} cannot be written: {hint}")


def _display() -> Finding:
    variables = ("DISPLAY", "WAYLAND_DISPLAY")
    shown = not sys.platform.startswith("linux") or any(os.environ.get(v) for v in variables)
    hint = "there is one" if shown else "none: use `roadlog view --web`, --save or --png"
    return Finding("viewer", "display", True if shown else None, hint)
