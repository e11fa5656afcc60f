"""Files appear whole or not at all, and no file of anybody else is lost on the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from roadlog import files
from roadlog.errors import LogWriteError

FOREIGN = b"precious"
told_by_locks = pytest.mark.skipif(
    not files.HAS_LOCKS, reason="no lock tells whether the run that left it lives"
)


def test_a_file_takes_its_place_at_the_end(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    with files.replacing(out) as file:
        file.write(b"half")
        assert not out.exists()
        file.write(b" and whole")
    assert out.read_bytes() == b"half and whole"
    assert list(tmp_path.iterdir()) == [out]


def test_a_failure_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_bytes(FOREIGN)
    with pytest.raises(TypeError), files.replacing(out) as file:
        file.writelines([b"half", 1])  # type: ignore[list-item]
    assert out.read_bytes() == FOREIGN
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("name", ["out.csv.undo", "out.csv.part", ".out.csv.abcdefgh.part",
                                  ".roadlog-1-0123456789abcdef.part",
                                  ".roadlog-1-0123456789abcdef-0123456789abcdef.part"])  # fmt: skip
def test_a_neighbour_stays(tmp_path: Path, name: str) -> None:
    neighbour = tmp_path / name
    neighbour.write_bytes(FOREIGN)
    files.write(tmp_path / "out.csv", "ours")
    assert neighbour.read_bytes() == FOREIGN


@told_by_locks
def test_what_a_killed_run_left_goes(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from roadlog import files\n"
        "with files.replacing(Path(sys.argv[1])) as file:\n"
        "    file.write(b'x' * 5000000); file.flush(); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.csv")], check=False)
    (left,) = tmp_path.iterdir()
    assert left.stat().st_size == 5_000_000
    with files.replacing(tmp_path / "b.csv"):
        assert not left.exists()
        files.write(tmp_path / "c.csv", "one that another run is writing stays")
    assert {path.name for path in tmp_path.iterdir()} == {"b.csv", "c.csv"}


KILLED_AT_THE_SWAP = """
import os, sys
from pathlib import Path
from roadlog import files
swap, out = files._exchange, Path(sys.argv[1])
def killed(one, other):
    sys.argv[2] == "before" or swap(one, other)
    sys.argv[2] == "changed" and one.write_bytes(b"by another")
    os.kill(os.getpid(), 9)
files._exchange = killed
files.write(out, "new")
"""


@told_by_locks
@pytest.mark.parametrize("instant", ["before", "after", "changed"])
def test_what_a_run_left_that_was_killed_at_the_swap_goes(tmp_path: Path, instant: str) -> None:
    """The old file is known by its state; what another program wrote to it is not ours."""
    out = tmp_path / "out.csv"
    out.write_bytes(b"old")
    subprocess.run([sys.executable, "-c", KILLED_AT_THE_SWAP, out, instant], check=False)
    assert out.read_bytes() == (b"old" if instant == "before" else b"new")
    (left,) = tmp_path.glob(".roadlog-*.part")
    files.write(tmp_path / "b.csv", "")
    assert left.exists() == (instant == "changed")
    assert out.read_bytes() == (b"old" if instant == "before" else b"new")


@told_by_locks
def test_what_a_run_left_that_was_killed_as_it_removed_a_journal_goes(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from roadlog import files\n"
        "files.remove(Path(sys.argv[1]), lambda _: next(calls) or os.kill(os.getpid(), 9))"
    )
    path = tmp_path / "x.mcap.undo"
    path.write_bytes(b"journal")
    code = f"calls = iter([True, False])\n{code}"
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    (left,) = tmp_path.iterdir()
    assert left != path
    files.write(tmp_path / "b.csv", "")
    assert not left.exists()


def test_what_appears_meanwhile_stays(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    with pytest.raises(LogWriteError, match="another"), files.replacing(out):
        out.write_bytes(FOREIGN)
    assert out.read_bytes() == FOREIGN
    assert list(tmp_path.iterdir()) == [out]


def test_what_changes_meanwhile_stays(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_bytes(b"old")
    with pytest.raises(LogWriteError, match="another program"), files.replacing(out):
        out.write_bytes(FOREIGN)
    assert out.read_bytes() == FOREIGN


def test_a_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    victim, out = tmp_path / "victim", tmp_path / "out.csv"
    victim.write_bytes(FOREIGN)
    out.symlink_to(victim)
    files.write(out, "ours")
    assert victim.read_bytes() == FOREIGN
    assert not out.is_symlink()


def test_an_output_is_never_an_input(tmp_path: Path) -> None:
    source = tmp_path / "s.csv"
    source.write_bytes(FOREIGN)
    hard, soft = tmp_path / "hard.csv", tmp_path / "soft.csv"
    os.link(source, hard)
    soft.symlink_to(source)
    for out in (source, hard, soft, tmp_path / "." / "s.csv"):
        with pytest.raises(LogWriteError, match="one of the inputs"):
            files.check_output(out, [source], force=True)
    with pytest.raises(LogWriteError, match="one of the inputs"):
        files.check_output(source, [tmp_path], force=True)
    files.check_output(tmp_path / "new.csv", [tmp_path])


def test_what_is_there_needs_force(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_bytes(FOREIGN)
    with pytest.raises(LogWriteError, match="--force"):
        files.check_output(out)
    files.check_output(out, force=True)
    for odd in (tmp_path, Path(os.devnull)):
        with pytest.raises(LogWriteError, match="name of a file"):
            files.check_output(odd, force=True)


def test_a_protected_file_stays(tmp_path: Path) -> None:
    """Root may write it all the same; that is not what its owner meant."""
    out = tmp_path / "out.csv"
    out.write_bytes(FOREIGN)
    out.chmod(0o444)
    with pytest.raises(LogWriteError, match=r"chmod u\+w"):
        files.write(out, "ours")
    assert out.read_bytes() == FOREIGN


def test_a_folder_that_was_made_for_nothing_goes(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b" / "out.csv"
    with pytest.raises(FileNotFoundError), files.output(out):
        (out.parent / "no.csv").read_bytes()
    assert not list(tmp_path.iterdir())
