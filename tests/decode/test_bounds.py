"""Bounds: whatever a capture holds, a table, a text, a transfer and a value stay within what is promised for them."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import encode
from kit.encode import Frame, Transfer
from kit.strategies import examples
from kit.traffic import MS, START, lines, push, status, throttle

import analyzer
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.schema import Type

LONGEST = 65_536  # bytes, or frames, of one transfer
SESSIONS = 65_536
BUSES = 255


def endless(size: int, count: int) -> list[Frame]:
    """One start and then `count` frames of `size` bytes without an end, 20 us apart."""
    first = push(5).frames()[0]
    later = [replace(first, data=bytes(size) + bytes([(k % 2 == 0) << 5 | 5])) for k in range(count)]
    return [replace(frame, t=START + 10 * MS + k * 20_000) for k, frame in enumerate([first, *later])]


@pytest.mark.slow
@pytest.mark.parametrize(("size", "count"), [(7, 12_000), (0, 70_000)])
def test_a_transfer_without_an_end(decode: Callable[..., Any], size: int, count: int) -> None:
    frames = endless(size, count)
    after = [replace(f, t=frames[-1].t + MS + k) for k, f in enumerate(push(6).frames())]
    got = decode(lines(push(4).frames(), frames, after))
    assert [row["status"] for row in got.transfers] == ["ok", "interrupted", "ok"]
    broken = got.transfers[1]
    assert "limit" in broken["anomaly"]
    assert len(broken["payload"]) <= LONGEST + 7
    assert len(broken["frame"]) <= LONGEST + 1
    assert max(len(broken["payload"]), len(broken["frame"])) > LONGEST - 7  # and not much earlier
    assert got.verdicts.count("orphan") == len(frames) - len(broken["frame"])


def test_the_longest_transfer_that_is_taken(decode: Callable[..., Any]) -> None:
    """Far longer than any type, but within the bound: whole, though more than the type can hold."""
    sent = replace(push(5), payload=push(5).payload + bytes(60_000))
    got = decode(lines(push(4).frames(), sent.frames(START + 10 * MS, 50_000)))
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]
    assert got.transfers[1]["payload"] == sent.payload
    assert "long" in got.transfers[1]["anomaly"]
    assert len(got.messages["PUSHCAN"][1]["data"]) <= 255
    assert got.messages["PUSHCAN"][1]["bits_left"] == 8 * (len(sent.payload) - 4 - 255)


@pytest.mark.slow
def test_more_sessions_than_are_followed(decode: Callable[..., Any]) -> None:
    extra = 3_000
    numbers = [type_id << 8 | node for type_id in range(5000, 5000 + 545) for node in range(1, 127)]
    ids = numbers[: SESSIONS - 1 + extra]
    assert len(ids) == SESSIONS - 1 + extra
    text = "".join(f"(1700000000.{k:06}) can0 {can_id:08X}#0100\n" for k, can_id in enumerate(ids, 100))
    late = throttle(5).frames()[0]
    last = "".join(encode.log_line(replace(late, t=START + 10**9 + k), 9) + "\n" for k in range(1))
    first = encode.log_line(replace(throttle(4).frames()[0], t=START)) + "\n"
    new = encode.log_line(replace(status(4).frames()[0], t=START + 10**9 + 5), 9) + "\n"
    got = decode((first + text + last + new).encode())
    refused = [k for k, row in enumerate(got.frames) if "limit" in row["anomaly"]]
    assert refused == [*range(SESSIONS, SESSIONS + extra), len(got.frames) - 1]
    assert {got.verdicts[k] for k in refused} == {"foreign"}
    assert [row["transfer_id"] for row in got.transfers] == [4, 5]  # the session that was there first goes on


def test_more_interfaces_than_a_byte_counts(decode: Callable[..., Any]) -> None:
    some = [throttle(k % 32).frames(START + k * MS, bus=f"bus{k}")[0] for k in range(300)]
    out = [encode.log_line(frame) + "\n" for frame in some]
    out.append(encode.log_line(throttle(1).frames(START + 400 * MS, bus="bus0")[0]) + "\n")
    got = decode("".join(out).encode())
    buses = got.engine.buses
    assert len(set(buses)) == len(buses) <= 256
    assert [buses[row["bus"]] for row in got.frames] == [f"bus{row['line'] - 1}" for row in got.frames[:-1]] + ["bus0"]
    told = [row["line"] for row in got.events if row["kind"] == "unreadable"]
    assert sorted(told + [row["line"] for row in got.frames]) == list(range(1, 302))
    assert len(told) <= 300 - BUSES


@pytest.mark.parametrize("step", [1 << 16, 1 << 24])
def test_a_line_without_an_end(decode: Callable[..., Any], step: int) -> None:
    data = b"(1700000000.000000) can0 1F040601#" + b"E8" * 5_000_000
    good = lines(throttle(4).frames())
    got = decode(good, *(data[k : k + step] for k in range(0, len(data), step)), b"\n", good, data)
    assert [row["line"] for row in got.frames] == [1, 3]
    events = [row for row in got.events if row["kind"] == "unreadable"]
    assert [row["line"] for row in events] == [2, 4]
    assert max(len(row["text"]) for row in events) < 300
    assert got.engine.totals.lines["lines"] == 4


@pytest.mark.slow
def test_a_line_without_an_end_is_not_kept(tmp_path: Path) -> None:
    """A quarter of a gigabyte without a newline leaves less than a tenth of it in memory."""
    code = """
import resource
from analyzer.decode.engine import Engine
engine, chunk = Engine(), b"(1.0) can0 1F040601#" + b"E8" * (1 << 19)
list(engine.feed(chunk))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for _ in range(250):
    list(engine.feed(chunk))
engine.finish()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    search = os.pathsep.join([str(Path(analyzer.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": search},
    )  # fmt: skip
    assert int(done.stdout) < 25_000


def test_all_transfer_ids_open_at_once(decode: Callable[..., Any]) -> None:
    ways = [status(k, rpm=k).frames() for k in range(32)]
    mixed = [replace(way[step], t=START + MS) for step in range(3) for way in ways]
    got = decode(lines(status(31).frames(), mixed))
    assert [(row["transfer_id"], row["status"]) for row in got.transfers] == [(31, "ok")] + [
        (k, "ok") for k in range(32)
    ]
    assert [row["rpm"] for row in got.messages["ESCStatus"]] == [-5, *range(32)]


def test_many_starts_leave_few_open(decode: Callable[..., Any]) -> None:
    """Starts alone, thousands of them: never more than one slot a transfer id."""
    first = status(0).frames()[0]
    count = 5_000
    starts = [
        replace(first, data=k.to_bytes(7, "big") + bytes([0x80 | k % 32]), t=START + 10 * MS + k * 1000)
        for k in range(count)
    ]
    got = decode(lines(status(4).frames(), starts))
    assert [row["status"] for row in got.transfers] == ["ok"] + ["interrupted"] * (count - 1) + ["open"]
    assert all(len(row["frame"]) == 1 for row in got.transfers[1:])


def test_what_is_held_back_is_bounded(decode: Callable[..., Any], flush: object) -> None:
    """An unknown type that never proves itself cannot pile up frames; what is settled late is a handful."""
    frames = [encode.Frame(0x1F03E71E, bytes([k % 256, 0xC0 | 2 * k % 32])) for k in range(3000)]
    proof = [encode.Frame(0x1F03E71E, bytes([k, 0xC0 | k])) for k in range(5)]
    got = decode(lines(frames), flush, lines(proof))
    assert sum(len(batch.settled) for batch in got.batches) <= 512
    assert got.verdicts[: 3000 - 512] == ["foreign"] * (3000 - 512)


@pytest.mark.parametrize("long", [b"#" + b"x" * 100_000, b"\x1b[2J" * 1000, b"\xff\xfe" * 5000])
def test_texts_are_short_and_valid(decode: Callable[..., Any], long: bytes) -> None:
    got = decode(long + b"\n" + b"(1700000000.000000) " + long + b" 123#00\n")
    for row in got.events:
        assert len(row["text"].encode()) < 1000
    assert got.engine.totals.lines["lines"] == 2


def within(layout: Type, value: Any) -> bool:
    """Whether a value fits its layout: width of a number, length of a list, one member of a union."""
    if value is None:
        return True
    if isinstance(layout, ArrayType):
        limit = len(value) <= layout.max if layout.dynamic else len(value) == layout.max
        return limit and all(within(layout.element, item) for item in value)
    if isinstance(layout, CompoundType):
        members = [m for m in layout.fields if m.name in value]
        active = sum(value[m.name] is not None for m in members)
        return (active <= 1 or not layout.union) and all(within(m.type, value[m.name]) for m in members)
    assert isinstance(layout, PrimitiveType)
    if layout.kind == "uint":
        return 0 <= value < 1 << layout.bits
    if layout.kind == "int":
        return -(1 << layout.bits - 1) <= value < 1 << layout.bits - 1
    return True


payloads = st.builds(
    lambda size, seed: random.Random(seed).randbytes(size) if seed else b"\xff" * size,
    st.integers(0, 420),
    st.integers(0, 5),
)
NAMES = sorted(name for name, of in encode.TYPES.items() if of.kind != "response")


@examples(300, derandomize=True)
@given(name=st.sampled_from(NAMES), payload=payloads, fd=st.booleans())
def test_values_stay_within_their_layout(
    decode: Callable[..., Any], registry: Any, name: str, payload: bytes, fd: bool
) -> None:
    """Payloads of random bytes and any length, in transfers that are otherwise right."""
    of = encode.TYPES[name]
    dst = 9 if of.kind == "request" else None
    sent = [Transfer(of.kind, of.type_id, 8, payload, of.signature, k, dst, fd=fd) for k in range(3)]
    frames = [frame for one in sent for frame in one.frames()]
    got = decode(lines(frames))
    assert [row["status"] for row in got.transfers] == ["ok"] * 3
    message = registry.message({"message": 0, "request": 2}[of.kind], of.type_id)
    assert len(got.messages[message.table]) == 3
    for row in got.messages[message.table]:
        for member in message.layout.fields:
            note = message.notes.get(member.name)
            if member.name in row and (note is None or note.scale is None):
                assert within(member.type, row[member.name]), member.name
        assert row["bits_left"] <= 8 * len(sent[0].padded)
