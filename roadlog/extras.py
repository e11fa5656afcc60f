"""The optional dependencies: which packages an extra brings, and whether they are there."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import metadata

PACKAGE = "roadlog"


@dataclass(frozen=True)
class Requirement:
    """One line of the package's requirements. extra: empty for what is always needed."""

    package: str
    wanted: str  # with its bounds
    extra: str

    @property
    def version(self) -> str | None:
        """As installed; None where it is not."""
        try:
            return metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return None


def requirements() -> list[Requirement]:
    """Of the installed package. Raises PackageNotFoundError where it runs from its sources."""
    found = []
    for line in metadata.requires(PACKAGE) or []:
        name = re.match(r"[\w.-]+", line)
        extra = re.search(r"extra == ['\"]([\w-]+)['\"]", line)
        if name and name.group() != PACKAGE:
            wanted = line.partition(";")[0].strip()
            found.append(Requirement(name.group(), wanted, extra[1] if extra else ""))
    return found


def is_installed(extra: str) -> bool:
    """Whether all packages of an extra are there, as far as roadlog knows them."""
    try:
        return all(r.version is not None for r in requirements() if r.extra == extra)
    except metadata.PackageNotFoundError:
        return True
