"""Several captures as one: order, names, clocks, frames that two of them hold, and sums that still add up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.command import CAPTURES, HOVER, START
from kit.exported import by_time, flight, merge, piece, seen, text, write
from kit.strategies import examples

from analyzer._native import Merger
from analyzer.decode.engine import Engine
from analyzer.sources import Source
from analyzer.sources.merge import Plan, bus_name, open_captures

if TYPE_CHECKING:
    import random
    from collections.abc import Callable
    from pathlib import Path

    from kit.exported import Record

    Command = Callable[..., tuple[int, str, str]]

TIMES = st.one_of(st.none(), st.integers(0, 40).map(lambda n: START + n * 10**9))


@st.composite
def captures(draw: st.DrawFn) -> list[list[Record]]:
    """Up to four captures of buses of their own; times rise mostly."""
    out, number = [], iter(range(10**6))
    for index in range(draw(st.integers(1, 4))):
        times = draw(st.lists(TIMES, max_size=12))
        if draw(st.booleans()):
            times = sorted((t for t in times if t is not None), key=int)
        out.append([(t, f"can{index}", next(number)) for t in times])
    return out


@pytest.mark.slow
@given(captures(), st.randoms(use_true_random=False))
@examples(300)
def test_the_order_is_that_of_the_times(given_: list[list[Record]], chance: random.Random) -> None:
    merger = Merger([(0, [])] * len(given_), same_bus=False)
    rest = [[piece(text([record])) for record in records] for records in given_]
    out = []
    while (index := merger.awaited) is not None:
        if chance.random() < 0.3:
            index = chance.randrange(len(given_))  # whoever is early
        if rest[index]:
            merger.push(index, rest[index].pop(0), "")
        else:
            merger.finish(index)
        out.append(merger.take())
    got, lines = seen(out)
    assert got == by_time(given_)
    assert lines["frames"] == sum(t is not None for records in given_ for t, *_ in records)


def test_a_bus_that_two_captures_hold_is_there_once(tmp_path: Path) -> None:
    """Each of them lost some frames; the clocks differ by a little, and one says which way frames went."""
    frames = flight(1)
    first = [f for n, f in enumerate(frames[:300]) if n % 7]
    second = [(t + 150_000, bus, data) for n, (t, bus, data) in enumerate(frames[100:], 100) if n % 11]
    got, lines, source = merge(tmp_path, text(first), text(second, " R"))
    assert lines["repeated"] == sum(n % 7 != 0 and n % 11 != 0 for n in range(100, 300))
    assert {data for *_, data in got} == {data for *_, data in first} | {data for *_, data in second}
    assert lines["frames"] == len({data for *_, data in got}) == len(got)
    assert source.parts[1].notes == []


def test_frames_that_were_sent_again_stay(tmp_path: Path) -> None:
    """The same content twice in one capture is two frames, and pairs with two of the other."""
    frames = [(START + n * 10**9 + k * 5_000_000, "can0", 7) for n in range(20) for k in range(2)]
    got, lines, _ = merge(tmp_path, text(frames), text(frames))
    assert (len(got), lines["repeated"]) == (40, 40)
    got, lines, _ = merge(tmp_path, text(frames), text([(t, "can1", data) for t, _, data in frames]))
    assert (len(got), lines["repeated"]) == (80, 0)
    got, lines, _ = merge(
        tmp_path, text(frames), text([(t, "can1", data) for t, _, data in frames]), plan=Plan(same_bus=True)
    )
    assert (len(got), lines["repeated"], {bus for _, bus, _ in got}) == (40, 40, {"can0"})


@pytest.mark.slow
def test_many_equal_frames_at_one_time(tmp_path: Path) -> None:
    frames = [(START, "can0", 7)] * 100_000
    got, lines, _ = merge(tmp_path, text(frames), text(frames), text(frames[:50_000]))
    assert (len(got), lines["repeated"]) == (100_000, 150_000)


def test_three_captures_of_one_bus(tmp_path: Path) -> None:
    frames = flight(2)
    got, lines, _ = merge(tmp_path, text(frames), text(frames[50:]), text(frames[:350]))
    assert got == frames
    assert lines["repeated"] == 700


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ({}, {"can0", "can1", "can2"}),
        ({"0.log": "left"}, {"left", "can1", "can2"}),
        ({"can1": "x"}, {"can0", "x", "can2"}),
        ({"0.log:can1": "x"}, {"can0", "x", "can1", "can2"}),
        ({"0.log": "left", "0.log:can1": "x"}, {"left", "x", "can1", "can2"}),
        ({"0.log": "left", "1.log": "right"}, {"left", "right"}),
        ({"0.log": "left", "can1": "x"}, {"left", "x", "can2"}),
        ({"nowhere": "x"}, {"can0", "can1", "can2"}),
    ],
)
def test_buses_get_names(tmp_path: Path, names: dict[str, str], expected: set[str]) -> None:
    first = [(START, "can0", 1), (START + 10**9, "can1", 2)]
    second = [(START + 2 * 10**9, "can1", 3), (START + 3 * 10**9, "can2", 4)]
    got, _, _ = merge(tmp_path, text(first), text(second), plan=Plan(names))
    assert {bus for _, bus, _ in got} == expected
    assert [data for *_, data in got] == [1, 2, 3, 4]


@pytest.mark.parametrize("wrong", ["", "x", "x=", "=x", "a b=x", "\x1b=x", "n" * 65 + "=x"])
def test_bus_names_are_checked(wrong: str) -> None:
    with pytest.raises(ValueError, match="is not NAME=CAPTURE"):
        bus_name(wrong)
    assert bus_name("left=dir/a.log:can0") == ("dir/a.log:can0", "left")


def test_one_interface_too_many(tmp_path: Path) -> None:
    frames = [(START + n, f"bus{n}", n) for n in range(200)]
    others = [(START + 1000 + n, f"more{n}", n) for n in range(100)]
    merged = open_captures([str(write(tmp_path / "a", frames)), str(write(tmp_path / "b", others))])
    engine = Engine()
    events = [row for batch in engine.run(merged.chunks()) for row in batch.events.to_pylist()]
    assert engine.totals.balanced
    assert [row["text"] for row in events] == ["one interface too many"] * 45


@pytest.mark.slow
def test_a_split_capture_decodes_as_the_whole(tmp_path: Path, command: Command) -> None:
    lines = HOVER.read_bytes().splitlines(keepends=True)
    halves = [tmp_path / "a.log", tmp_path / "b.log"]
    for half, part in zip(halves, (lines[:1000], lines[1000:]), strict=True):
        half.write_bytes(b"".join(part))
    whole = command("decode", HOVER, "-T", "jsonl")
    for names in (halves, halves[::-1], [tmp_path / "?.log"]):
        assert command("decode", *names, "-T", "jsonl")[:2] == whole[:2]


def test_complaints_name_capture_and_line(tmp_path: Path, command: Command) -> None:
    faults = CAPTURES / "faults.log"
    alone = command("decode", "-q", faults)[2].splitlines()[0]
    bad = tmp_path / "bad.log"
    bad.write_bytes(b"(1773475330.0) can1 nonsense\n")
    status, _, err = command("decode", "-q", faults, bad)
    assert status == 3
    assert f"{bad}: line 1: " in err
    assert alone in err
    status, out, _ = command("info", faults, bad, HOVER)
    assert status == 3
    assert [line.split()[0] for line in out.splitlines() if line.startswith(("File", "SHA"))] == ["File", "SHA-256"] * 3
    missing = tmp_path / "missing"
    status, _, err = command("decode", "-q", HOVER, missing)
    assert (status, err) == (3, f"tailbyte: {missing}: No such file or directory\n")


def test_an_empty_capture_is_said(tmp_path: Path, command: Command) -> None:
    empty = tmp_path / "empty.log"
    empty.touch()
    status, _, err = command("decode", "-q", HOVER, empty)
    assert (status, err.splitlines()[0]) == (3, f"tailbyte: {empty}: empty")


@pytest.mark.parametrize(
    ("what", "named"), [("can9", "can9"), ("hover.log:can1", "hover.log:can1"), ("b=c", "b=c"), ("x.log", "x.log")]
)
def test_a_name_for_nothing_is_refused(command: Command, what: str, named: str) -> None:
    status, _, err = command("decode", "-q", HOVER, "--bus", f"left={what}")
    assert status == 2
    assert f"--bus left={named}: no such capture or interface (there is can0)" in err


def test_sources_have_one_interface() -> None:
    single, merged = Source(str(HOVER)), open_captures([str(HOVER)] * 2, Plan())
    for source in (single, merged):
        for _ in source.chunks():
            pass
        assert source.damage is None
        assert not source.live
        assert not source.waits
        assert source.length == source.size == sum(part.size for part in source.parts)
        assert str(HOVER) in source.name
        source.stopped = True
        assert all(part.stopped for part in source.parts)
