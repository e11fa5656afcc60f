"""Takes away what Windows does not have. Imported first in a process, before anything else.

`python -m pytest -p support.no_posix` runs any test that way.
"""

from __future__ import annotations

import mmap
import os
import signal
import sys
from importlib.abc import MetaPathFinder

MODULES = ("fcntl", "pwd", "grp", "resource", "termios", "pty", "tty")
CALLS = {
    os: """fork forkpty fchmod fchown sync geteuid getuid getpgid setsid killpg statvfs sendfile
    copy_file_range posix_fadvise O_NOFOLLOW O_DIRECTORY O_NONBLOCK O_CLOEXEC""",
    signal: "SIGALRM setitimer pthread_sigmask SIGKILL SIGHUP",
    mmap: "MADV_DONTNEED PROT_READ MAP_SHARED MAP_PRIVATE",
}


class Absent(MetaPathFinder):
    """Refuses the modules."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        del path, target
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


for name in MODULES:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Absent())
for module, names in CALLS.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
