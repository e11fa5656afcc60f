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
class Check:
    """One line of the examination. ok: None where something optional is not there."""

    topic: str
    name: str
    ok: bool | None
    found: str


def examine() -> list[Check]:
    """Look at everything that roadlog leans on; nothing is changed and nothing is sent."""
    return [
        Check("roadlog", "version", True, __version__),
        Check("python", "version", sys.version_info >= (3, 11), platform.python_version()),
        Check("python", "platform", True, platform.platform()),
        *_packages(),
        _schemas(),
        _compile_cache(),
        _display(),
    ]


def _packages() -> list[Check]:
    """Every requirement of the installed package: the core ones must be there."""
    try:
        known = requirements()
    except metadata.PackageNotFoundError:
        return [Check("core", PACKAGE, None, "runs from its sources and is not installed")]
    return [_package(r) for r in known if r.extra not in NOT_FOR_USERS]


def _package(needed: Requirement) -> Check:
    topic = f"extra {needed.extra}" if needed.extra else "core"
    if version := needed.version:
        from packaging import requirements as bounds

        fits = bounds.Requirement(needed.wanted).specifier.contains(version, prereleases=True)
        hint = version if fits else f"{version}: pip install --upgrade '{needed.wanted}'"
        return Check(topic, needed.wanted, fits, hint)
    what = f"roadlog[{needed.extra}]" if needed.extra else needed.wanted
    hint = f"missing: pip install '{what}'"
    return Check(topic, needed.wanted, None if needed.extra else False, hint)


def _schemas() -> Check:
    from roadlog.storage import schemas

    try:
        return Check("log", "schemas", True, f"{len(schemas.names())} messages")
    except (OSError, ValueError) as error:
        return Check("log", "schemas", False, f"{error}: install roadlog again")


def _compile_cache() -> Check:
    """Compiled code is kept beside the source, or where NUMBA_CACHE_DIR says."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parent / "filters")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return Check("compiler", "cache", True, f"{folder} can be written")
    except OSError:
        hint = "set NUMBA_CACHE_DIR to a folder that can, or every run may compile anew"
        return Check("compiler", "cache", None, f"{folder} cannot be written: {hint}")


def _display() -> Check:
    variables = ("DISPLAY", "WAYLAND_DISPLAY")
    shown = not sys.platform.startswith("linux") or any(os.environ.get(v) for v in variables)
    hint = "there is one" if shown else "none: use `roadlog view --web`, --save or --png"
    return Check("viewer", "display", True if shown else None, hint)
