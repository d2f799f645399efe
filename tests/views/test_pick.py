"""Few rows of a batch are cut out before they are written: what is written is the same, whatever counts as few."""

from __future__ import annotations

from itertools import pairwise

import pytest
from kit import CAPTURES

from analyzer.__main__ import main
from analyzer.views import pick

FILTERS = ("ESCStatus && ch == 2", "PUSHCAN || RawCommand", 'dronecan.status != "ok"', "frame.number % 7 == 0")
OUTPUTS = (
    ["-t", "d"], ["-t", "dd"], ["-t", "ad"], ["-V"], ["-x"], ["-V", "-x", "-P"], ["-T", "jsonl"], ["-T", "csv"],
    ["-T", "fields", "-e", "frame.number", "-e", "frame.time_delta", "-e", "frame.time", "-e", "frame.data",
     "-e", "ESCStatus.rpm", "-e", "PUSHCAN.MotorStatus.voltage"],
)  # fmt: skip


def written(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    main(["decode", *words])
    return capsys.readouterr().out


@pytest.mark.parametrize("output", OUTPUTS, ids=" ".join)
@pytest.mark.parametrize("name", ["hover-4.log", "faults.log", "fd.log"])
def test_few_rows_are_written_as_many_are(
    name: str, output: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = set()
    for rows in FILTERS:
        words = [str(CAPTURES / name), *output, "-Y", rows]
        monkeypatch.setattr(pick, "_FEW", 1)
        cut = written(words, capsys)
        monkeypatch.setattr(pick, "_FEW", 1 << 40)
        assert written(words, capsys) == cut
        said.add(cut)
    assert len(said) > 1


@pytest.mark.parametrize("name", ["hover-4.log", "mission-8-faults.log"])
def test_time_since_the_transfer_before_is_that_of_the_list(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Transfers overlap: each line has the time since the line above, and a filter leaves it as it is."""
    log = str(CAPTURES / name)

    def times(*words: str) -> dict[str, tuple[int, int]]:
        asked = ["-e", "frame.number", "-e", "frame.time_relative", "-e", "frame.time_delta"]
        cells = [line.split("\t") for line in written([log, "-T", "fields", *asked, *words], capsys).splitlines()]
        return {number: (nanoseconds(at), nanoseconds(since)) for number, at, since in cells}

    every = times()
    moments = [at for at, _ in every.values()]
    assert [since for _, since in every.values()] == [0, *(b - a for a, b in pairwise(moments))]
    some = times("-Y", "NodeStatus")
    assert some
    assert some.items() <= every.items()
    listed = [line.removeprefix("x").split() for line in written([log, "-t", "d"], capsys).splitlines()]
    since = {row[0]: row[1] for row in listed if row[0] in every}
    assert {number: nanoseconds(text) // 1000 for number, text in since.items()} == {
        number: value // 1000 for number, (_, value) in every.items()
    }


def test_time_since_the_frame_before_is_that_of_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    log = str(CAPTURES / "hover-4.log")

    def times(*words: str) -> set[tuple[str, ...]]:
        lines = written([log, "--frame-list", *words], capsys).splitlines()
        return {tuple(line.split()[:2]) for line in lines[1:]}

    some = times("-t", "d", "-Y", "PUSHCAN")
    assert some < times("-t", "d")
    assert not some <= times("-t", "dd", "-Y", "PUSHCAN")


def nanoseconds(text: str) -> int:
    whole, _, rest = text.partition(".")
    return int(whole) * 10**9 + int(rest.ljust(9, "0"))
