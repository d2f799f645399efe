"""Filters of `frame.*` and `can.*` select what tshark selects: the numbers that 4.0.17 gave, and tshark itself."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES

import dissectors
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.filter import compile_filter

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch

KNOWN = json.loads(Path(__file__).with_name("tshark.json").read_text())
FRAMES: dict[str, dict[str, str]] = KNOWN["frames"]
REMOTE = {"faults": 77}  # has no data; tshark takes the zeros that stand in its record for some
UNTIMED = "dialects.txt"  # some of its frames have no time; in pcapng all have one
LONG = {"dialects.txt": {36}}  # a remote frame with a DLC of 15, which is `can.len` here; pcapng has room for 8 alone
SHORT = "data.data[2] != 00"  # frames of two bytes have no third one: null here, another one for tshark
TSHARK = shutil.which("tshark")


def part(name: str, folder: Path) -> Path:
    """Write the lines of a capture that tshark was shown."""
    first, last = KNOWN["parts"][name]
    path = folder / f"{name}.log"
    if not path.exists():
        path.write_text("".join((CAPTURES / f"{name}.log").read_text().splitlines(keepends=True)[first - 1 : last]))
    return path


@cache
def batches(path: Path) -> list[Batch]:
    return list(Run(Request((str(path),), threads=1)).batches())


def numbers(text: str) -> list[int]:
    spans = [one.partition("-") for one in text.split()]
    return [n for first, _, last in spans for n in range(int(first), int(last or first) + 1)]


def selected(path: Path, text: str) -> list[int]:
    """Return the numbers, as Wireshark counts, of the frames and error frames that a filter of frames selects."""
    matcher = compile_filter(text, dissectors.load(), wireshark=True).matcher(frame_list=True)
    rows: dict[int, bool] = {}
    for batch in batches(path):
        matches = matcher.feed(batch)
        numbering = matches.numbering
        rows |= dict(
            zip(
                numbering.of_all(range(batch.first_frame, batch.first_frame + len(batch.frames))).tolist(),
                matches.frames.tolist(),
                strict=True,
            )
        )
        places, members = matches.members
        rows |= dict(zip(numbering.of_all(places).tolist(), members.tolist(), strict=True))
        errors = numbering.of_errors(batch.first_frame, batch.frames, batch.events).tolist()
        rows |= dict(zip(errors, matches.events[matches.error_rows].tolist(), strict=True))
    return sorted(number for number, good in rows.items() if good)


def seen(name: str, text: str, frames: list[int]) -> list[int]:
    return [number for number in frames if "data" not in text or number != REMOTE.get(name)]


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tshark")


def test_there_are_enough() -> None:
    assert len(FRAMES) >= 60
    assert len({tuple(rows.values()) for rows in FRAMES.values()}) > 40


@pytest.mark.parametrize("text", FRAMES)
def test_the_same_frames(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    for name, frames in FRAMES[text].items():
        if text == SHORT and name == "fd":  # where such frames are
            continue
        assert seen(name, text, selected(part(name, folder), text)) == seen(name, text, numbers(frames)), name


def remotes(path: Path) -> list[int]:
    """Return the remote frames; see `REMOTE`."""
    return selected(path, "can.flags.rtr == 1")


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN["captures"])
def test_as_many_frames_of_whole_captures(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many, with the same sum of their numbers, for each filter."""
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    path = CAPTURES / name
    for text, summary in zip(FRAMES, KNOWN["captures"][name], strict=True):
        if name == UNTIMED and "frame.time" in text:
            continue
        found = set(selected(path, text))
        odd = set(remotes(path)) if "data" in text else LONG.get(name, set()) if "can.len" in text else set[int]()
        some = [found - odd | set(more) for size in range(len(odd) + 1) for more in combinations(odd, size)]
        assert summary in [f"{len(one)} {sum(one)}" for one in some] or text == SHORT, text


@pytest.mark.slow
@pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
@pytest.mark.parametrize("name", KNOWN["parts"])
def test_tshark_itself(name: str, folder: Path, command: Callable[..., Any]) -> None:
    path = part(name, folder)
    other = folder / f"{name}.pcapng"
    command("convert", path, other)
    for text in FRAMES:
        if text == SHORT and name == "fd":
            continue
        arguments = [str(TSHARK), "-r", str(other), "-Y", text, "-T", "fields", "-e", "frame.number"]
        found = subprocess.run(arguments, capture_output=True, text=True, check=True, env={"TZ": "UTC"})
        _, out, _ = command(
            "decode", path, "--frame-list", "--number", "wireshark", "-T", "fields", "-e", "frame.number", "-Y", text
        )
        theirs, ours = (seen(name, text, list(map(int, some.split()))) for some in (found.stdout, out))
        assert ours == theirs, text
