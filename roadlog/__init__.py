"""Road grade and bank, vehicle pitch and roll, from the log of an ordinary drive.

```python
import roadlog

with roadlog.open("drive.mcap") as log:
    estimate = log.estimate("fusion")
    estimate.grade  # rad, on estimate.time
    estimate.to_pandas()
    estimate.errors(log.truth()).grade
```

`estimators`, `simulate` and `ingest` are imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roadlog.errors import RoadlogError

if TYPE_CHECKING:
    from roadlog import estimators, ingest, simulate
    from roadlog.car.vehicle import Vehicle
    from roadlog.drive import Drive
    from roadlog.estimate import Estimate
    from roadlog.log import DriveLog, create
    from roadlog.version import __version__

__all__ = [
    "Drive",
    "DriveLog",
    "Estimate",
    "RoadlogError",
    "Vehicle",
    "__version__",
    "create",
    "estimators",
    "ingest",
    "simulate",
]  # and `open`, which a star import should not put over Python's own

_MODULES = ("estimators", "ingest", "simulate")
_NAMES = {
    "__version__": "roadlog.version",
    "Drive": "roadlog.drive",
    "DriveLog": "roadlog.log",
    "Estimate": "roadlog.estimate",
    "Vehicle": "roadlog.car.vehicle",
    "create": "roadlog.log",
}


def open(path: Path | str, profile: Path | str | None = None) -> DriveLog:
    """A drive log on disk; profile: for a third-party MCAP. Raises LogReadError, ConfigError."""
    from roadlog.log import DriveLog  # imports what computes; `import roadlog` alone stays fast

    return DriveLog(path, profile)


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"roadlog.{name}")
    if name in _NAMES:
        return getattr(import_module(_NAMES[name]), name)
    raise AttributeError(f"module 'roadlog' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES, *_NAMES])
