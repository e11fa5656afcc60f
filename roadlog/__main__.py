"""The command line, from its first instant on: `python -m roadlog`, `roadlog`."""

from __future__ import annotations

from roadlog import interrupt


def main() -> None:
    """Run a command; a signal ends it with one line, however far it came."""
    try:
        interrupt.install()
        from roadlog.cli import main as run

        run()
    except BaseException:  # whatever an interrupt became on its way up
        if interrupt.was_seen():
            interrupt.end()
        interrupt.done()
        raise
    interrupt.done()


if __name__ == "__main__":
    main()
