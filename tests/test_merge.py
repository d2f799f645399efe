"""Several captures as one: order, names, clocks, frames that two of them hold, and sums that still add up."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest
from command import CAPTURES, HOVER, START
from hypothesis import given, settings
from hypothesis import strategies as st

from analyzer._native import Merger, Reader
from analyzer.engine import LINES, Engine, Totals
from analyzer.sources import Source
from analyzer.sources.errors import MergeError
from analyzer.sources.merge import Merged, Plan, bus_name, open_captures
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from analyzer._native import Piece

    Command = Callable[..., tuple[int, str, str]]

NO_TIME = None
# time in nanoseconds (None: comment line), interface, data
Record = tuple[int | None, str, int]


def text(records: Iterable[Record], direction: str = "") -> bytes:
    lines = [
        f"# {data}\n" if t is None else f"({t // 10**9}.{t % 10**9:09d}) {bus} 1F040601#{data:016X}{direction}\n"
        for t, bus, data in records
    ]
    return "".join(lines).encode()


def piece(data: bytes) -> Piece:
    reader = Reader("candump")
    reader.feed(data)
    reader.finish()
    return reader.take()


def seen(pieces: Iterable[Piece | bytes]) -> tuple[list[Record], dict[str, int]]:
    """The records that came out, comments among them, and the sum over all pieces; their numbers must rise."""
    out: list[tuple[int, Record]] = []
    lines = dict.fromkeys(LINES, 0)
    for part in pieces:
        assert not isinstance(part, bytes)
        frames, events = (table_rows(columns) for columns in part.columns())
        names = part.buses
        out += [(r["line"], (r["t"], names[r["bus"]], int.from_bytes(r["data"], "big"))) for r in frames]
        out += [(r["line"], (None, "", int(r["text"].rpartition("# ")[2]))) for r in events]
        for name, count in part.lines.items():
            if name in lines:
                lines[name] += count
    assert Totals(lines).balanced
    out.sort(key=lambda row: row[0])
    numbers = [number for number, _ in out]
    assert len(set(numbers)) == len(numbers)
    assert all(1 <= number <= lines["lines"] for number in numbers)
    return [record for _, record in out], lines


def table_rows(columns: dict[str, Any]) -> list[dict[str, Any]]:
    from analyzer.cut import RECORDED  # noqa: PLC0415
    from analyzer.tables import EVENT_ROWS, raw_times, wrap  # noqa: PLC0415

    batch = wrap(RECORDED if "id" in columns else EVENT_ROWS, columns)
    times = raw_times(batch.column("t"))
    rest = batch.select(batch.schema.names[1:]).to_pylist()
    return [{"t": t, **row} for t, row in zip(times, rest, strict=True)]


def by_time(captures: list[list[Record]]) -> list[Record]:
    """What merging means: stable, by the latest time so far of each capture."""
    keyed = []
    for index, records in enumerate(captures):
        latest = -1
        for at, record in enumerate(records):
            latest = max(latest, -1 if record[0] is None else record[0])
            keyed.append((latest, index, at, record if record[0] is not None else (None, "", record[2])))
    return [record for *_, record in sorted(keyed, key=lambda row: row[:3])]


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


@given(captures(), st.randoms(use_true_random=False))
@settings(max_examples=300, deadline=None)
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


def merge(tmp_path: Path, *contents: bytes, plan: Plan | None = None) -> tuple[list[Record], dict[str, int], Merged]:
    names = []
    for index, content in enumerate(contents):
        path = tmp_path / f"{index}.log"
        path.write_bytes(content)
        names.append(str(path))
    source = open_captures(names, plan)
    assert isinstance(source, Merged)
    return *seen(rows(source.chunks())), source


def flight(seed: int, *, start: int = START, bus: str = "can0", count: int = 400) -> list[Record]:
    """Frames that do not repeat, a millisecond or two apart."""
    chance = random.Random(seed)
    t, out = start, []
    for _ in range(count):
        t += chance.randrange(500_000, 3_000_000)
        out.append((t, bus, chance.getrandbits(56) << 8 | 0xC0 | len(out) % 32))
    return out


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


def test_many_equal_frames_at_one_time(tmp_path: Path) -> None:
    frames = [(START, "can0", 7)] * 100_000
    got, lines, _ = merge(tmp_path, text(frames), text(frames), text(frames[:50_000]))
    assert (len(got), lines["repeated"]) == (100_000, 150_000)


def test_three_captures_of_one_bus(tmp_path: Path) -> None:
    frames = flight(2)
    got, lines, _ = merge(tmp_path, text(frames), text(frames[50:]), text(frames[:350]))
    assert got == frames
    assert lines["repeated"] == 700


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


def write(path: Path, records: list[Record]) -> Path:
    path.write_bytes(text(records))
    return path


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
