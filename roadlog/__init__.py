"""Road grade and bank, vehicle pitch and roll, from the log of an ordinary drive.

```python
import roadlog

log = roadlog.open("drive.mcap")
estimate = log.estimate("fusion")
estimate.grade        # rad, on estimate.time
estimate.to_pandas()
```
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from roadlog.version import __version__

if TYPE_CHECKING:
    from roadlog.log import DriveLog

__all__ = ["__version__", "open"]


def open(path: Path | str, profile: Path | str | None = None) -> DriveLog:
    """A drive log on disk; profile: for a third-party MCAP. Raises LogReadError, ConfigError."""
    from roadlog.log import DriveLog  # imports what computes; `import roadlog` alone stays fast

    return DriveLog(path, profile)
