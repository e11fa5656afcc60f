"""First on a child's path, so that it too lacks what Windows does not have."""

from support import no_posix  # noqa: F401
