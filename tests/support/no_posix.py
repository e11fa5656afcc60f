"""Takes away what Windows does not have, from this process and from every Python that it starts.

`make test-no-posix` runs the whole suite so (`pytest -p support.no_posix`): a test of what only
POSIX has is skipped by name, everything else must pass.
"""

from __future__ import annotations

import mmap
import os
import signal
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any

# these go by the system's name, not by what there is: before; O_NONBLOCK and user ids stay for them
PEERS = ("filelock", "locket", "platformdirs", "psutil")
MODULES = ("fcntl", "pwd", "grp", "resource", "termios", "pty", "tty")
CALLS = {
    os: """fork forkpty fchmod fchown sync getpgid setsid killpg statvfs pwrite pread
    copy_file_range posix_fadvise O_NOFOLLOW O_DIRECTORY""",
    signal: "SIGALRM setitimer pthread_sigmask SIGHUP",
    mmap: "MADV_DONTNEED PROT_READ MAP_SHARED MAP_PRIVATE",
}
TESTS = Path(__file__).parents[1]


class Absent(MetaPathFinder):
    """Refuses the modules."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        del path, target
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


class Child(subprocess.Popen):
    """A process whose Python takes the same away first, by tests/no_posix/sitecustomize.py."""

    def __init__(self, *arguments: Any, env: Any = None, **options: Any) -> None:
        super().__init__(*arguments, env=_first(os.environ if env is None else env), **options)


def _first(environment: Any) -> dict[str, str]:
    own = [str(TESTS / "no_posix"), str(TESTS)]
    before = environment.get("PYTHONPATH", "").split(os.pathsep)
    path = [*own, *(p for p in before if p and p not in own)]
    return {**environment, "PYTHONPATH": os.pathsep.join(path)}


for name in PEERS:
    with suppress(ImportError):
        import_module(name)
for name in MODULES:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Absent())
for module, names in CALLS.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
subprocess.Popen = Child  # type: ignore[misc]
os.environ.update(_first(os.environ))  # for those that multiprocessing starts
