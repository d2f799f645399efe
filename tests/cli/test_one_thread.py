"""One thread or more: the same bytes on standard output, on standard error and in files."""

from __future__ import annotations

import gzip
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

COMMANDS = [
    ("decode", "-q"),
    ("decode", "--frame-list"),
    ("decode", "-T", "jsonl", "--findings"),
    ("decode", "-c", "7"),
    ("decode", "--around", "40"),
    ("info", "--all"),
    ("check", "--json", "out/report.json"),
    ("check", "--from", "0.2", "--to", "1"),
    ("export", "--force", "--table", "all", "--table", "findings", "--table", "esc", "-o", "out"),
    ("convert", "out/capture.mcap"),
]
EARLY = {"-c", "--around"}  # reading ends with the rows that are shown


@pytest.fixture(scope="module")
def captures() -> dict[str, bytes]:
    """A flight that is whole, and one with damage of many kinds that is cut short."""
    log = (Path(__file__).parents[2] / "captures" / "hover-4.log").read_bytes()
    lines = log.splitlines(keepends=True)
    lines[3::17] = [line[:-4] + b"00\n" for line in lines[3::17]]
    lines[5::41] = [b"no frame\n"] * len(lines[5::41])
    return {"whole.log": log, "broken.log.gz": gzip.compress(b"".join(lines))[:-2000]}


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The threads that have been started to work ahead."""
    names: list[str] = []
    start = threading.Thread.start

    def noted(thread: threading.Thread) -> None:
        names.append(thread.name)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", noted)
    yield names
    assert not [thread for thread in threading.enumerate() if thread.name in ("ahead", "judging")]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("capture", ["whole.log", "broken.log.gz"])
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_threads_change_nothing(
    command: tuple[str, ...],
    capture: str,
    captures: dict[str, bytes],
    made: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:
    found = []
    for count in ("1", "2"):
        room = tmp_path / count
        (room / "out").mkdir(parents=True)
        monkeypatch.chdir(room)
        (room / capture).write_bytes(captures[capture])
        name, *rest = command
        status = main([name, capture, *rest, "--threads", count])
        files = {path.name: path.read_bytes() for path in sorted((room / "out").iterdir())}
        found.append((status, capfdbinary.readouterr(), files))
        assert ("ahead" in made) == (count == "2" and not EARLY & set(command))
    assert found[0] == found[1]
