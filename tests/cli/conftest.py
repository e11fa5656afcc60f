"""The command line's own tests run it in their process; `roadlog_process` is a real one."""

from __future__ import annotations

import io
import logging
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from support.drives import PLAIN, Run

from roadlog.cli import console, main


@pytest.fixture
def roadlog(tmp_path: Path) -> Run:
    """Run the command line in this process, from `tmp_path`: `roadlog("info", path)`."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = ["roadlog", *map(str, arguments)]
        out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
        log = logging.getLogger("roadlog")
        with (
            pytest.MonkeyPatch.context() as patch,
            warnings.catch_warnings(),
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            patch.chdir(tmp_path)
            patch.setattr(sys, "argv", command)
            patch.setattr(log, "handlers", [*log.handlers])
            for name in ("debug", "quiet", "verbose"):
                patch.setattr(console, name, False)
            for name, value in PLAIN.items():
                patch.setenv(name, value)
            code: object = 0
            try:
                main()
            except SystemExit as end:
                code = end.code or 0
        texts = (stream.buffer.getvalue().decode() for stream in (out, err))
        return subprocess.CompletedProcess(command, code, *texts)

    return run
