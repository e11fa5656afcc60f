"""Sources of every kind to one drive log: `formats` to read them, `profile` for what names mean."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from roadlog.ingest.sources import IngestResult, Source, expanded, ingest, open_source

__all__ = ["IngestResult", "Source", "expanded", "ingest", "open_source"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'roadlog.ingest' has no attribute '{name}'")
    from roadlog.ingest import sources  # a log alone asks for its profile, not for the formats

    return getattr(sources, name)


class _Module(ModuleType):
    """`roadlog.ingest(...)` is `roadlog.ingest.ingest(...)`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self.ingest(*arguments, **options)


sys.modules[__name__].__class__ = _Module
