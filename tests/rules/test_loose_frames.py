"""Frames outside of transfers: what is kept of them in columns is what is there, and so is what the core finds."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from kit.judged import registry
from kit.strategies import examples

from analyzer._native import Firsts, FrameIndex, Remainders, tails_before
from analyzer.decode.engine import Engine
from analyzer.decode.sent import cells
from analyzer.rules import recent
from analyzer.rules.judge import Judge
from analyzer.rules.transfers.loose_frames import LooseFrames
from analyzer.rules.transfers.open_frames import OpenFrames
from analyzer.tables import TAIL_END, TAIL_ID
from dissectors.kit.definitions import Types, crc_start

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pytest

OPEN, NAMED, TIMEOUT = 3, 2, 10
orphans = st.tuples(
    st.integers(0, 4), st.integers(0, 5), st.sampled_from((1, 2, TAIL_END | 1)), st.integers(1, 8)
)  # session, time since the one before, tail byte, bytes


def frames(rows: Sequence[tuple[int, ...]], first: int = 0) -> LooseFrames:
    """Return frames by session, time, tail byte and size, numbered from one on."""
    found = LooseFrames.blank(len(rows))
    found.number[:] = np.arange(len(rows)) + first
    for name, column in zip(("session", "t", "tail", "size"), np.array(rows, np.int64).reshape(-1, 4).T, strict=True):
        getattr(found, name)[:] = column
    return found


class PlainRemainders:
    """The same one by one."""

    def __init__(self) -> None:
        self.open: dict[int, tuple[int, int, list[int], int]] = {}  # transfer ID, latest, numbers, bytes
        self.closed: list[tuple[list[int], int]] = []

    def close(self, session: int) -> None:
        *_, numbers, received = self.open.pop(session)
        self.closed.append((numbers, received))

    def add(self, number: int, session: int, t: int, tail: int, size: int) -> None:
        known = self.open.get(session)
        if known is not None and (known[0] != tail & TAIL_ID or t - known[1] > TIMEOUT):
            self.close(session)
        if session not in self.open and len(self.open) == OPEN:
            self.close(next(iter(self.open)))
        _, _, numbers, received = self.open.get(session, (0, 0, [], 0))
        numbers = [*numbers, number][:NAMED]
        self.open[session] = tail & TAIL_ID, t, numbers, received + size - 1
        if tail & TAIL_END:
            self.close(session)


@examples(200)
@given(st.lists(st.lists(orphans, max_size=20), max_size=6))
def test_remainders_have_their_frames_whatever_comes_at_once(parts: list[list[tuple[int, int, int, int]]]) -> None:
    core, plain, slots_of, found = Remainders(OPEN, NAMED, TIMEOUT), PlainRemainders(), OpenFrames(), []
    first = t = 0
    for k, part in enumerate(parts):
        rows = []
        for session, since, tail, size in part:
            t += since
            rows.append((session, t, tail, size))
        some = frames(rows, first)
        made = core.add(some.session, some.t, some.tail, some.size, k == len(parts) - 1)
        slots, ended, offsets, received = (cells(column, np.int64) for column in made)
        slots_of.put(slots[slots >= 0], some.take(slots >= 0))
        numbers = slots_of.take(ended).number.tolist()
        for at, total in enumerate(received.tolist()):
            found.append((numbers[offsets[at] : offsets[at + 1]], total))
        for number, row in enumerate(rows, first):
            plain.add(number, *row)
        first += len(rows)
    for session in [*plain.open] if parts else ():
        plain.close(session)
    assert found == plain.closed


@given(st.lists(st.lists(st.integers(0, 99), max_size=5), max_size=4), st.data())
def test_frames_are_taken_and_joined_as_rows(parts: list[list[int]], data: st.DataObject) -> None:
    lists = [sorted(part) for part in parts]
    some = []
    for numbers in lists:
        one = LooseFrames.blank(len(numbers))
        one.number[:], one.tail[:] = numbers, np.array(numbers, np.int64) % 7
        if data.draw(st.booleans()):
            one.lines = np.array([str(number) for number in numbers], object)
        some.append(one)
    whole = LooseFrames.joined(some)
    assert whole.number.tolist() == sorted(chain(*lists))
    assert whole.tail.tolist() == [number % 7 for number in whole.number.tolist()]
    lines = [""] * len(whole) if whole.lines is None else whole.lines.tolist()
    assert all(line in {"", str(number)} for line, number in zip(lines, whole.number.tolist(), strict=True))
    assert sum(map(bool, lines)) == sum(len(one) for one in some if one.lines is not None)
    mask = np.array(data.draw(st.lists(st.booleans(), min_size=len(whole), max_size=len(whole))), bool)
    for rows in (mask, mask.nonzero()[0], slice(1, 3)):
        taken = whole.take(rows)
        assert taken.number.tolist() == whole.number[rows].tolist()
        assert (taken.lines is None) == (whole.lines is None)
        assert taken.lines is None or taken.lines.tolist() == np.array(lines, object)[rows].tolist()


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=30), st.integers(1, 8), st.integers(1, 6))
def test_the_tail_before_a_frame_is_that_of_its_session(rows: list[tuple[int, int]], step: int, look: int) -> None:
    """Sessions and sizes; the tail byte of a frame is its number."""
    batches = []
    for first in range(0, len(rows), step):
        part = rows[first : first + step]
        data = [bytes(size)[1:] + bytes([first + k]) if size else b"" for k, (_, size) in enumerate(part)]
        count, ends = len(part), np.cumsum([0, *map(len, data)], dtype=np.int32)
        columns = np.zeros(count, np.int64), np.ones(count, np.uint8), np.array([one for one, _ in part], np.uint32)
        batches.append(
            FrameIndex(first, *columns, np.ones(count, np.uint16), ends, np.frombuffer(b"".join(data), np.uint8))
        )
    numbers = np.arange(len(rows))
    sessions = 1 << 32 | np.array([one for one, _ in rows], np.int64)
    expected = [
        next((k for k in reversed(range(max(at - look, 0), at)) if rows[k][0] == session and rows[k][1]), -1)
        for at, (session, _) in enumerate(rows)
    ]
    assert cells(tails_before(batches, numbers, sessions, look), np.int16).tolist() == expected


@given(st.lists(st.lists(st.integers(0, 9), max_size=8)), st.integers(0, 6))
def test_the_first_of_each_key_is_known(parts: list[list[int]], most: int) -> None:
    firsts, expected, number = Firsts(most), dict[int, int](), 0
    for keys in parts:
        before = len(expected)
        for at, key in enumerate(keys, number):
            if len(expected) < most or key in expected:
                expected.setdefault(key, at)
        numbers = np.arange(number, number + len(keys))
        assert firsts.add(np.array(keys, np.int64), 10 * numbers, numbers) == len(expected) - before
        number += len(keys)
    every = np.arange(10)
    assert cells(firsts.has(every), bool).tolist() == [key in expected for key in range(10)]
    t, numbers = (cells(column, np.int64).tolist() for column in firsts.find(every, -5, -7))
    assert numbers == [expected.get(key, -7) for key in range(10)]
    assert t == [10 * expected[key] if key in expected else -5 for key in range(10)]


def test_lines_of_frames_that_are_gone_were_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rest of a transfer waits for its end while frames come for which the recent past has no room."""
    monkeypatch.setattr(recent, "KEPT", 1024)
    others = [f"({1 + k / 1000:.6f}) can0 1401550C#{k:08X}000000{0xC0 | k % 32:02X}" for k in range(3500)]
    mine = ((0, 0x83), (1, 0x63), (400, 0x24), (401, 0x04), (3000, 0x45))
    sent = [f"({1 + at / 1000:.6f}) can0 14040A0C#{'AB' * 7}{tail:02X}" for at, tail in mine]
    lines, running, judge = sorted([*others, *sent]), Engine(registry()), Judge(registry())
    for at in range(0, len(lines), 50):
        for batch in [*running.feed("".join(f"{one}\n" for one in lines[at : at + 50]).encode()), running.flush()]:
            judge.feed(batch)
    (lost,) = [run for key, run in judge.finish().runs if (key.rule, key.severity) == ("TRF-005", "note")]
    assert [line.split()[2] for line in lost.examples[0].lines] == [line.split()[2] for line in sent[2:4]]


def test_framings_are_those_of_the_definitions() -> None:
    types = Types(registry())
    for code in (1034, 341, 2 << 16 | 1, 19999):
        starts, size = types.framing(code)
        assert (starts, size) == ([crc_start(one) for one in types.signatures(code)], types.fixed_bytes(code))
        assert types.framing(code)[0] is starts
