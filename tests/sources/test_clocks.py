"""Clocks of captures that are merged: found from common frames, given, or without any relation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.command import START
from kit.exported import by_time, flight, merge, seen, text, write

from analyzer.sources.errors import MergeError
from analyzer.sources.merge import Plan
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]


def test_clocks_that_drift_apart(tmp_path: Path) -> None:
    frames = flight(3, count=5000)
    drifting = [(t + (t - START) // 100, bus, data) for t, bus, data in frames]  # 1 %: 90 ms in the end
    _, lines, _ = merge(tmp_path, text(frames), text(drifting))
    assert (lines["frames"], lines["repeated"]) == (5000, 5000)


@pytest.mark.parametrize("shift", [-3_600_000_000_000, -1_500_000_123, 700_000_000, 86_400_000_000_000])
def test_the_offset_is_found_from_common_frames(tmp_path: Path, shift: int) -> None:
    frames = flight(4)
    other = [(t + shift, "can7", data) for t, _, data in frames[200:]]
    got, lines, source = merge(tmp_path, text(frames), text(other), plan=Plan(same_bus=True))
    assert (got, lines["repeated"]) == (frames, 200)
    assert source.parts[1].notes == [f"times shifted by {-shift / 1e9:+.6f} s, as 200 common frames show"]
    again = source.again()
    assert seen(rows(again.chunks()))[0] == frames
    assert again.found == source.found


def test_a_third_capture_may_meet_the_second_only(tmp_path: Path) -> None:
    frames = flight(5)
    second = [(t - 10**12, bus, data) for t, bus, data in frames[100:300]]
    third = [(t + 10**12, bus, data) for t, bus, data in frames[250:]]
    got, lines, source = merge(tmp_path, text(frames[:200]), text(second), text(third))
    assert (got, lines["repeated"]) == (frames, 150)
    assert source.found == {1: (10**12, 100), 2: (-(10**12), 50)}


def test_two_flights_are_not_taken_for_one(tmp_path: Path) -> None:
    """After every start the same frames come (up times, versions), but most of the traffic differs."""
    day = 86_400_000_000_000
    common = [(START + n * 10**9, "can0", n) for n in range(60)]
    first = sorted(common + flight(6, count=4000))
    second = sorted([(t + day, bus, data) for t, bus, data in common] + flight(7, start=START + day, count=4000))
    got, lines, source = merge(tmp_path, text(first), text(second))
    assert (got, lines["repeated"], source.found) == (first + second, 0, {})


def test_an_offset_that_is_given_counts(tmp_path: Path) -> None:
    frames = flight(8)
    other = [(t - 5 * 10**9, "can1", data) for t, _, data in flight(9)]
    got, _, source = merge(tmp_path, text(frames), text(other), plan=Plan(offsets={"1.log": 5 * 10**9}))
    assert got == by_time([frames, [(t + 5 * 10**9, "can1", data) for t, _, data in other]])
    assert source.parts[1].notes == []
    got, _, _ = merge(tmp_path, text(frames), plan=Plan(offsets={"0.log": -START}))
    assert [t for t, *_ in got] == [t - START for t, *_ in frames]


def test_a_capture_follows_the_one_that_was_shifted(tmp_path: Path) -> None:
    frames = flight(14)
    second = [(t - 10**12, bus, data) for t, bus, data in frames[100:]]
    got, lines, source = merge(tmp_path, text(frames[:300]), text(second), plan=Plan(offsets={"0.log": 7 * 10**9}))
    assert got == [(t + 7 * 10**9, bus, data) for t, bus, data in frames]
    assert (lines["repeated"], source.found) == (200, {1: (10**12 + 7 * 10**9, 200)})


def test_clocks_without_a_relation_are_refused(tmp_path: Path) -> None:
    relative = [(t - START, bus, data) for t, bus, data in flight(10)]
    for contents in ([flight(11), relative], [relative, flight(11)]):
        with pytest.raises(MergeError, match=r"do not count from one clock .* give --offset 1\.log=\+1\.5s"):
            merge(tmp_path, *map(text, contents))
    got, _, _ = merge(tmp_path, text(flight(11)), text(relative), plan=Plan(offsets={"1.log": START}))
    assert len(got) == 800
    got, _, _ = merge(tmp_path, text(relative), text(flight(11)), plan=Plan(offsets={"0.log": START}))
    assert len(got) == 800
    got, lines, _ = merge(tmp_path, text(flight(10)), text(relative))  # the same flight: the frames tell
    assert (len(got), lines["repeated"]) == (400, 400)
    with pytest.raises(MergeError, match=r"1\.log has no times: it cannot be merged"):
        merge(tmp_path, text(flight(11)), b"  can0  1F040601   [8]  00 00 00 00 00 00 00 C0\n")


def test_windows_read_merged_captures_again(tmp_path: Path, command: Command) -> None:
    """The end is known last: the captures are read a second time, with the offset found by the first."""
    frames = flight(12, count=3000)
    late = write(tmp_path / "late.log", [(t + 10**12, bus, data) for t, bus, data in frames[1000:]])
    early = write(tmp_path / "early.log", frames)
    status, out, err = command("decode", early, late, "--last", "1s", "-T", "jsonl")
    assert status == 0, err
    assert "times shifted by -1000.000000 s, as 2000 common frames show" in err
    last = [t for t, *_ in frames if t >= frames[-1][0] - 10**9]
    assert len(out.splitlines()) == len(last)
