"""Outputs are there whole or not at all, whatever ends the writing."""

from __future__ import annotations

import errno
import os
import re
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from kit.command import LIMIT, environment

from analyzer.sinks.atomic import Target, TargetError, TargetFolder

TEXT = b"new " * 100_000


@pytest.fixture(params=[None, b"old"], ids=["free name", "existing file"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "out.log"
    if request.param is not None:
        path.write_bytes(request.param)
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def content(path: Path) -> bytes | None:
    """Of the only file there may be in the folder."""
    assert list(path.parent.iterdir()) == ([path] if path.exists() else [])
    return path.read_bytes() if path.exists() else None


def test_it_appears_at_the_end(place: Path) -> None:
    before = content(place)
    with Target(str(place)) as target:
        target.file.write(TEXT)
        target.file.flush()
        assert (place.read_bytes() if place.exists() else None) == before
        assert len(list(place.parent.iterdir())) == 1 + (before is not None)
    assert content(place) == TEXT


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_what_was_there(place: Path, error: type[BaseException]) -> None:
    before = content(place)

    def fail() -> None:
        with Target(str(place)) as target:
            target.file.write(TEXT)
            raise error

    with pytest.raises(error):
        fail()
    assert content(place) == before


def child(code: str, *args: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", code, *map(str, args)]
    return subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)


FULL = """
import resource, sys
sys.dont_write_bytecode = True  # half a file of it
from analyzer.sinks.atomic import Target, TargetError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    with Target(sys.argv[1]) as target:
        for _ in range(10):
            target.file.write(b"x" * 100_000)
except TargetError as error:
    sys.exit(str(error))
"""


@pytest.mark.sampled(2)
@pytest.mark.parametrize("room", [0, 100, 500_000, 999_999])
def test_a_full_disk_leaves_what_was_there(place: Path, room: int) -> None:
    before = content(place)
    process = child(FULL, place, room)
    _, err = process.communicate(timeout=LIMIT)
    assert (process.returncode, err.decode()) == (1, f"{place}: File too large\n")
    assert content(place) == before
    process = child(FULL, place, 1_000_000)
    assert (process.communicate(timeout=LIMIT), process.returncode) == ((b"", b""), 0)
    assert content(place) == b"x" * 1_000_000


def test_a_disk_that_is_full_only_at_the_end(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As network file systems have it."""
    before = content(place)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TargetError, match=r"out\.log: No space left on device$"), Target(str(place)) as target:
        target.file.write(TEXT)
    assert content(place) == before
    with pytest.raises(TargetError, match="No space left"), TargetFolder(str(place.parent / "folder")) as folder:
        folder.open("a").write(TEXT)
    assert content(place) == before


WAITING = """
import sys, time
from analyzer.sinks.atomic import Target, TargetFolder
with Target(sys.argv[1]) if sys.argv[2] == "file" else TargetFolder(sys.argv[1]) as target:
    file = target.file if sys.argv[2] == "file" else target.open("part")
    file.write(b"x" * 1_000_000)
    print("written", flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_ctrl_c_leaves_nothing(tmp_path: Path, kind: str) -> None:
    process = child(WAITING, tmp_path / "out", kind)
    assert process.stdout is not None
    assert process.stdout.readline() == b"written\n"
    assert len(list(tmp_path.iterdir())) == 1
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=LIMIT)
    assert process.returncode == -signal.SIGINT
    assert list(tmp_path.iterdir()) == []


def test_a_kill_leaves_the_name_free(place: Path) -> None:
    before = place.exists()
    process = child(WAITING, place, "file")
    assert process.stdout is not None
    assert process.stdout.readline() == b"written\n"
    process.kill()
    process.communicate(timeout=LIMIT)
    assert place.exists() == before
    assert [
        bool(re.fullmatch(r"out\.log\.[0-9a-f]{8}\.part", p.name)) for p in place.parent.iterdir() if p != place
    ] == [True]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_permissions_are_those_of_any_new_file(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        with Target(str(tmp_path / "ours")) as target, TargetFolder(str(tmp_path / "folder")) as folder:
            target.file.write(b"x")
            folder.open("ours").write(b"x")
        (tmp_path / "any").touch()
        (tmp_path / "anyfolder").mkdir()
    finally:
        os.umask(before)
    modes = {path.relative_to(tmp_path).as_posix(): path.stat().st_mode for path in tmp_path.rglob("*")}
    assert modes["ours"] == modes["any"] == modes["folder/ours"]
    assert modes["folder"] == modes["anyfolder"]


def test_an_existing_file_keeps_its_permissions_and_its_links(tmp_path: Path) -> None:
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_bytes(b"old")
    path.chmod(0o640)
    link.symlink_to("file")
    with Target(str(link)) as target:
        target.file.write(b"new")
    assert (link.is_symlink(), path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (True, b"new", 0o640)


def test_a_long_name(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 255)
    with Target(str(path)) as target:
        target.file.write(b"x")
    assert content(path) == b"x"


def test_names_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for name, reason in (
        (str(tmp_path), "is a directory"),
        (str(tmp_path / "missing" / "out"), f"there is no folder {tmp_path / 'missing'}"),
        (str(tmp_path / "file" / "out"), "Not a directory"),
        (str(tmp_path / ("n" * 256)), "File name too long"),
    ):
        with pytest.raises(TargetError) as told, Target(name):
            pass
        assert str(told.value) == f"{name}: {reason}"
    with pytest.raises(TargetError, match=r"a\\0b: embedded null") as told, Target("a\0b"):
        pass
    assert names(tmp_path) == ["file"]


def test_permission_denied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Told here what the system tells everybody but the superuser."""
    readonly = tmp_path / "readonly"
    readonly.write_bytes(b"old")

    def denied(path: str, *_: object) -> int:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)

    monkeypatch.setattr(os, "open", denied)
    for name in ("readonly", "new"):
        with pytest.raises(TargetError, match=f"{name}: Permission denied$"), Target(str(tmp_path / name)):
            pass
    assert content(readonly) == b"old"


def test_devices_and_pipes_are_written_directly(tmp_path: Path) -> None:
    with Target("/dev/null") as target:
        target.file.write(TEXT)
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    with pytest.raises(TargetError, match=r"^/dev/full: No space left on device$"), Target("/dev/full") as target:
        target.file.write(TEXT)
    fifo, got = tmp_path / "fifo", list[bytes]()
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: got.append(fifo.read_bytes()))
    reader.start()
    with Target(str(fifo)) as target:
        target.file.write(TEXT)
    reader.join(LIMIT)
    assert (got, names(tmp_path)) == ([TEXT], ["fifo"])


STDOUT = """
import sys
from analyzer.sinks.atomic import Target, TargetError
try:
    with Target("-") as target:
        target.file.write(b"bytes")
    print(" and text")
except TargetError as error:
    sys.exit(str(error))
"""


def test_standard_output() -> None:
    assert child(STDOUT).communicate(timeout=LIMIT) == (b"bytes and text\n", b"")
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-c", STDOUT], env=environment(), stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert (done.returncode, done.stderr) == (1, b"standard output: No space left on device\n")


@pytest.mark.parametrize("exists", [False, True])
def test_a_folder_appears_at_the_end(tmp_path: Path, exists: bool) -> None:
    path = tmp_path / "out"
    if exists:
        path.mkdir()
        (path / "a").write_bytes(b"old")
        (path / "other").write_bytes(b"other")
    with TargetFolder(str(path)) as folder:
        folder.open("a").write(TEXT)
        folder.open("b").close()
        assert path.exists() == exists
    assert {p.name: p.read_bytes() for p in path.iterdir()} == {"a": TEXT, "b": b""} | (
        {"other": b"other"} if exists else {}
    )
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("exists", [False, True])
def test_a_folder_whose_making_fails(tmp_path: Path, exists: bool) -> None:
    path = tmp_path / "out"
    if exists:
        path.mkdir()
        (path / "a").write_bytes(b"old")

    def fail() -> None:
        with TargetFolder(str(path)) as folder:
            folder.open("a").write(TEXT)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert [p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")] == (["out", "out/a"] if exists else [])
    assert not exists or (path / "a").read_bytes() == b"old"


def test_folders_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder" / "a").mkdir(parents=True)
    for name, reason in (("file", "is not a folder"), ("missing/out", f"there is no folder {tmp_path / 'missing'}")):
        with pytest.raises(TargetError) as told, TargetFolder(str(tmp_path / name)):
            pass
        assert str(told.value) == f"{tmp_path / name}: {reason}"
    with pytest.raises(TargetError, match="folder/a: is a directory"), TargetFolder(str(tmp_path / "folder")) as folder:
        folder.open("a")
    assert names(tmp_path / "folder") == ["a"]
