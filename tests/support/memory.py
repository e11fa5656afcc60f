"""How much memory a process has had."""

from __future__ import annotations

import sys


def peak() -> int:
    """Bytes that this process has had at most; what it has now where nothing counts that."""
    try:
        import resource
    except ImportError:
        import psutil

        now = psutil.Process().memory_info()
        return int(getattr(now, "peak_wset", now.rss))
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
