"""Frames of a bus by session, when each node was not heard, and the first transfers of sessions."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st
from kit.keyed import KeyedRows

from analyzer.rules.bus import sessions
from analyzer.rules.bus.heard import HeardNodes, HeardSessions
from analyzer.rules.bus.sessions import Session, bus_frames
from analyzer.tables import EXTENDED, FRAMES, KINDS, TAIL_END, TAIL_ID, TAIL_START, TRANSFERS
from dissectors.kit import FrameTable, TransferTable

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pytest

LEAST = 5
# Identifiers of two nodes: three messages, and a service one of them asks the other for.
IDS = (0x1803E80B, 0x1003E90B, 0x1003E80C, 0x1E018B8C, 0x1E010C8B)

Heard = tuple[int, int, int, bytes]  # time, identifier, bus, data
heard = st.tuples(
    st.integers(0, 12), st.sampled_from(IDS), st.integers(0, 1), st.binary(min_size=1, max_size=2)
)  # fmt: skip
captures = st.lists(heard, max_size=40).flatmap(
    lambda some: st.sampled_from([some, sorted(some, key=lambda one: one[0])])
)


def tables(rows: list[Heard], step: int) -> list[FrameTable]:
    found = []
    for at in range(0, len(rows), step):
        part = rows[at : at + step]
        columns = {
            "t": [one[0] for one in part], "bus": [one[2] for one in part], "id": [one[1] for one in part],
            "flags": [EXTENDED] * len(part), "line": [1] * len(part), "data": [one[3] for one in part],
            "verdict": [0] * len(part), "anomaly": [0] * len(part),
        }  # fmt: skip
        found.append(FrameTable(pa.RecordBatch.from_pydict(columns, schema=FRAMES), at))
    return found


def session_of(one: Heard) -> Session:
    _, identifier, bus, _ = one
    return Session(bus, identifier & 0x7F, identifier >> 8 & 0xFFFF | (identifier & 0x80) << 9)


@given(captures)
def test_each_session_has_its_frames_in_order(rows: list[Heard]) -> None:
    found: dict[Session, list[int]] = {}
    for frames in tables(rows, 40):
        for bus, ours in bus_frames(frames).items():
            own = [k for k, one in enumerate(rows) if one[2] == bus]
            for code, (begin, end) in zip(ours.codes.tolist(), pairwise(ours.first.tolist()), strict=True):
                session = Session.of(code)
                assert session.code == code
                found[session] = ours.row[begin:end].tolist()
                assert [own[place] for place in ours.place[begin:end].tolist()] == found[session]
                assert ours.tail[begin:end].tolist() == [rows[k][3][-1] for k in found[session]]
    expected: dict[Session, list[int]] = {}
    for k, one in enumerate(rows):
        expected.setdefault(session_of(one), []).append(k)
    assert found == expected


@given(captures, st.sampled_from([1, 3, 40]))
def test_gaps_of_nodes(rows: list[Heard], step: int) -> None:
    nodes = HeardNodes(LEAST)
    for frames in tables(rows, step):
        nodes.feed(frames)
    for bus in (0, 1):
        for node in (0x0B, 0x0C):
            own = [(one[0], k) for k, one in enumerate(rows) if (one[2], one[1] & 0x7F) == (bus, node)]
            far = [(a[0], b[0], a[1]) for a, b in pairwise(own) if b[0] - a[0] > LEAST]
            assert [gap[:3] for gap in nodes.gaps(bus, node, 0, 12)] == far
            inside = [gap for gap in far if gap[0] >= 3 and gap[1] <= 9]
            assert [gap[:3] for gap in nodes.gaps(bus, node, 3, 9)] == inside


@given(captures, st.sampled_from([1, 3, 40]))
def test_transfers_begin(rows: list[Heard], step: int) -> None:
    sessions, found = HeardSessions(), {}
    for frames in tables(rows, step):
        for begun in sessions.feed(frames):
            heard = list(zip(*(column.tolist() for column in (begun.t, begun.number, begun.lost)), strict=True))
            first = pairwise([0, *begun.size.cumsum().tolist()])
            each = zip(map(Session.of, begun.codes.tolist()), begun.place.tolist(), first, strict=True)
            for session, place, some in each:
                found.setdefault(session, []).extend(heard[slice(*some)])
                assert list(found)[place] == session
    expected: dict[Session, list[tuple[int, int, int]]] = {}
    last: dict[Session, tuple[bool, int, int]] = {}
    for k, one in enumerate(rows):
        session, tail = session_of(one), one[3][-1]
        ended, before, lost = last.get(session, (True, -1, 0))
        if session.type_id >> 16:
            continue
        if ended or tail & TAIL_START:
            lost += max((tail - before) % 32 - 1, 0) if before >= 0 else 0
            before = tail & TAIL_ID
            expected.setdefault(session, []).append((one[0], k, lost))
        last[session] = bool(tail & TAIL_END), before, lost
    assert found == expected


Kind = tuple[int, int, int, int, bool]
kinds = st.tuples(
    st.integers(0, 3), st.sampled_from([0x3E8, 0x3E9]), st.sampled_from([0x0B, 0x0C, 0x0D]), st.integers(0, 1),
    st.booleans(),
)  # fmt: skip


def _messages(rows: list[Kind]) -> Iterator[tuple[Session, int]]:
    for k, (kind, type_id, src, bus, _) in enumerate(rows):
        if KINDS[kind] == "message":
            yield Session(bus, src, type_id), k


@given(captures, st.lists(st.lists(kinds, max_size=12), max_size=3))
def test_sessions_are_proved_by_their_first_transfer(rows: list[Heard], parts: list[list[Kind]]) -> None:
    sessions, proved = HeardSessions(), dict[int, int]()
    places = dict.fromkeys(session_of(one) for one in sorted(rows, key=lambda one: session_of(one).code))
    known: list[Session] = []
    for frames in tables(rows, 40):
        for begun in sessions.feed(frames):
            known += map(Session.of, begun.codes.tolist())
    assert set(known) == {session for session in places if not session.type_id >> 16}
    for part in parts:
        names = {"kind": 0, "type_id": 1, "src": 2, "bus": 3}
        columns: dict[str, list[object]] = {one.name: [None] * len(part) if one.nullable else [] for one in TRANSFERS}
        columns |= {name: [one[at] for one in part] for name, at in names.items()}
        columns["variant"] = [int(one[4]) for one in part]
        transfers = TransferTable(pa.RecordBatch.from_pydict(columns, schema=TRANSFERS))
        new = {
            known.index(session): transfers.code.item(k)
            for session, k in reversed([*_messages(part)])
            if session in known and known.index(session) not in proved
        }
        found = dict(zip(*(column.tolist() for column in sessions.prove(transfers)), strict=True))
        assert found == new
        assert list(found) == sorted(found, key=lambda place: known[place].code)
        proved |= found


def test_another_thread_may_ask_for_its_batch_at_any_time(monkeypatch: pytest.MonkeyPatch) -> None:
    class Elsewhere(WeakKeyDictionary[FrameTable, object]):
        def __setitem__(self, _key: FrameTable, _value: object) -> None:
            self.clear()

    monkeypatch.setattr(sessions, "_known", Elsewhere())
    (table,) = tables([(0, IDS[0], 0, b"\xc0")], 1)
    assert list(bus_frames(table)) == [0]


@given(st.lists(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 99)), max_size=8)), st.integers(0, 6))
def test_rows_by_key(parts: list[list[tuple[int, int]]], most: int) -> None:
    rows, expected = KeyedRows({"first": -1, "count": 0}, most), dict[int, list[int]]()
    for part in parts:
        keys, values = np.array(part, np.int64).reshape(-1, 2).T
        new = dict.fromkeys(key for key, _ in part if key not in expected)
        assert rows.add(keys, first=values) == min(len(new), most - len(expected))
        for key, value in part:
            if key in expected or len(expected) < most:
                expected.setdefault(key, [value, 0])
        for key in expected:
            expected[key][1] += 1
        rows.put(rows.find(rows.keys), count=rows.look_up("count", rows.keys) + 1)
    assert rows.keys.tolist() == sorted(expected)
    assert (len(rows), rows.room) == (len(expected), most - len(expected))
    every = np.arange(10)
    assert rows.has(every).tolist() == [key in expected for key in range(10)]
    found = zip(rows.look_up("first", every).tolist(), rows.look_up("count", every).tolist(), strict=True)
    assert list(found) == [tuple(expected.get(key, (-1, 0))) for key in range(10)]
