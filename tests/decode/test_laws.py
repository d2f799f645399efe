"""Laws that hold for every input: nothing raises, nothing is lost, chunks do not matter, valid traffic comes out."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from hypothesis import given
from hypothesis import strategies as st
from kit import encode, strategies
from kit.strategies import examples
from kit.traffic import differing
from kit.vendors import physical

from analyzer.tables import EXTENDED, STATUSES

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.strategies import Capture, Sent

COMMON = examples(150, derandomize=True)
# Bytes that a candump line is made of, so that random text gets further than its first character.
WORDS = [
    b"(1700000000.000001)", b"(000.000000)", b"(2026-03-14 08:02:10.5)", b" ", b"  ", b"can0", b"vcan-1", b"1F040A0A",
    b"123", b"20000204", b"#", b"##1", b"R8", b"_E", b"E80FA03E80FA03C0", b"[8]", b"C0", b" C0", b" R", b"RX - -",
    b"\n", b"\r\n", b"ERRORFRAME", b"remote request", b"DROPCOUNT: dropped 3 CAN frame", b"Normal", b"# note",
    b"\0", b"\xff", b"'.......'",
]  # fmt: skip
soup = st.lists(st.one_of(st.sampled_from(WORDS), st.binary(max_size=5)), max_size=60).map(b"".join)


def tables(got: Any) -> dict[str, Any]:
    """Everything that must not depend on how the input was cut."""
    rows = {"frames": got.frames, "transfers": got.transfers, "events": got.events, **got.messages}
    text = {name: [repr(row) for row in table] for name, table in rows.items()}  # NaN equals itself as text
    return text | {"totals": got.engine.totals, "stamps": got.engine.stamps, "buses": got.engine.buses}


def pieces(data: bytes, cuts: list[int], flushes: list[bool], flush: object) -> list[object]:
    bounds = [0, *sorted({cut % (len(data) + 1) for cut in cuts}), len(data)]
    out: list[object] = []
    for (a, b), asked in zip(itertools.pairwise(bounds), itertools.chain(flushes, itertools.repeat(False))):  # noqa: B905
        out.append(data[a:b])
        if asked:
            out.append(flush)
    return out


@COMMON
@given(capture=strategies.captures())
def test_lines_and_frames_are_conserved(decode: Callable[..., Any], capture: Capture) -> None:
    got = decode(capture.data)
    assert got.engine.totals.lines["lines"] == capture.lines
    lines = [row["line"] for row in got.frames] + [row["line"] for row in got.events if row["kind"] != "gap"]
    assert len(set(lines)) == len(lines)
    assert set(lines) <= set(range(1, capture.lines + 1))
    for row in got.transfers:
        assert row["frame"] == sorted(set(row["frame"]))
        first, last = got.frames[row["frame"][0]], got.frames[row["frame"][-1]]
        assert (row["t"], row["t_end"], row["bus"]) == (first["t"], last["t"], first["bus"])
        assert row["src"] == first["id"] & 0x7F
        assert all(got.frames[k]["flags"] & EXTENDED for k in row["frame"])
        assert (row["crc_here"] is not None) <= (row["crc_wire"] is not None)
        assert (row["status"] == "bad crc") == (row["crc_here"] is not None and row["crc_here"] != row["crc_wire"])


def belongs(one: Sent, got: Any) -> list[dict[str, Any]]:
    numbers = {row["line"]: number for number, row in enumerate(got.frames)}
    mine = [numbers[line] for line in one.lines if line in numbers]
    return [row for row in got.transfers if set(row["frame"]) & set(mine)]


@COMMON
@given(capture=strategies.captures())
def test_calm_transfers_come_out_whole(decode: Callable[..., Any], capture: Capture) -> None:
    """Whatever is done to other sessions, a known transfer of an untouched session is there with all its values."""
    got = decode(capture.data)
    by_frame = {row["frame"][0]: number for number, row in enumerate(got.transfers)}
    line_of = {row["line"]: number for number, row in enumerate(got.frames)}
    for one in capture.sent:
        if not one.calm or one.name is None or not proven(one, capture.sent):
            continue
        row = got.transfers[by_frame[line_of[one.lines[0]]]]
        of = one.transfer
        assert [got.frames[k]["line"] for k in row["frame"]] == one.lines
        assert (row["status"], row["kind"], row["transfer_id"], row["priority"]) == (
            "ok", of.kind, of.transfer_id, of.priority,
        )  # fmt: skip
        assert (row["type_id"], row["src"], row["dst"], row["fd"]) == (of.type_id, of.src, of.dst, of.fd)
        assert (row["payload"], row["crc_wire"], row["crc_here"]) == (of.padded, of.crc, of.crc)
        table, message = got.message_of(by_frame[line_of[one.lines[0]]])
        assert table == one.name
        assert message["trusted"]
        assert differing(physical(table, one.fields), message) == {}, (table, one.lines)
        if not message["layout"] or of.fd:
            spare = len(of.padded) - len(of.payload)
            assert message["bits_left"] // 8 == spare


def proven(one: Sent, sent: list[Sent]) -> bool:
    """A few lone anonymous frames prove nothing, as any identifier that ends in 00 looks like them."""
    session = [other for other in sent if other.session == one.session]
    return one.transfer.kind != "anonymous" or len(session) >= 4


@COMMON
@given(capture=strategies.captures())
def test_one_damage_breaks_one_session(decode: Callable[..., Any], capture: Capture) -> None:
    """No broken transfer on a session to which nothing was done."""
    got = decode(capture.data)
    for one in capture.sent:
        if one.calm and one.name is not None:
            assert {row["status"] for row in belongs(one, got)} <= {"ok"}


@examples(300, derandomize=True)
@given(
    capture=strategies.captures(),
    cuts=st.lists(st.integers(0, 1 << 20), max_size=40),
    flushes=st.lists(st.booleans(), max_size=40),
)
def test_any_chunks_give_the_same_tables(
    decode: Callable[..., Any], flush: object, capture: Capture, cuts: list[int], flushes: list[bool]
) -> None:
    whole = tables(decode(capture.data))
    assert tables(decode(*pieces(capture.data, cuts, flushes, flush))) == whole


@examples(40, derandomize=True)
@given(capture=strategies.captures())
def test_byte_by_byte_with_a_flush_after_every_line(
    decode: Callable[..., Any], flush: object, capture: Capture
) -> None:
    whole = tables(decode(capture.data))
    single: list[object] = []
    for byte in capture.data:
        single.append(bytes([byte]))
        if byte == 0x0A:
            single.append(flush)
    assert tables(decode(*single)) == whole


@COMMON
@given(data=st.one_of(st.binary(max_size=300), soup), cuts=st.lists(st.integers(0, 300), max_size=8))
def test_nothing_raises(decode: Callable[..., Any], flush: object, data: bytes, cuts: list[int]) -> None:
    got = decode(data)
    ends = data.count(b"\n") + (not data.endswith(b"\n") and data != b"")
    assert got.engine.totals.lines["lines"] == ends
    assert tables(decode(*pieces(data, cuts, [True] * len(cuts), flush))) == tables(got)


@COMMON
@given(
    tails=st.lists(st.tuples(st.sampled_from([0x1F040A0A, 0x1F040A0A, 0x1F040F0A, 0x1F03E70A, 0x1801558A, 0x18000100]),
                             st.binary(max_size=8), st.integers(0, 3 * 10**9)), max_size=80)
)  # fmt: skip
def test_no_order_of_frames_raises(
    decode: Callable[..., Any], flush: object, tails: list[tuple[int, bytes, int]]
) -> None:
    """Tail bytes at random on few identifiers: far from valid traffic, near every branch of the reassembly."""
    now, out = strategies.START, []
    for can_id, data, wait in tails:
        now += wait if wait % 3 == 0 else wait // 1000
        out.append(encode.log_line(encode.Frame(can_id, data, now), 9).encode() + b"\n")
    got = decode(b"".join(out))
    assert tables(decode(*itertools.chain.from_iterable((line, flush) for line in out))) == tables(got)
    assert {row["status"] for row in got.transfers} <= set(STATUSES)


@COMMON
@given(capture=strategies.captures(max_damage=0))
def test_valid_traffic_shows_no_fault(decode: Callable[..., Any], capture: Capture) -> None:
    got = decode(capture.data)
    assert got.engine.totals.lines["unreadable"] == 0
    known = {(one.transfer.type_id, one.transfer.kind) for one in capture.sent if one.name}
    for row in got.transfers:
        if (row["type_id"], row["kind"]) in known:
            # A pause between two transfers or two frames may be long, but nothing is broken.
            assert row["status"] == "ok"
            assert row["anomaly"] <= {"can fd", "slow", "pause"}
    assert {mark for row in got.frames for mark in row["anomaly"]} == set()


def test_events_keep_the_order_of_the_lines(decode: Callable[..., Any]) -> None:
    """A gap is known at the frame that ends it, however much text came in one piece."""
    text = [
        b"(1700000000.000000) can0 1F040601#C0\n", b"(1700000005.000000) can0 1F040601#C1\n",
        b"(1700000005.100000) can0 20000204#0008000000006000\n", b"# note\n",
        b"(1700000009.000000) can0 1F040601#C2\n", b"junk\n",
    ]  # fmt: skip
    expected = [("gap", 2), ("error frame", 3), ("comment", 4), ("gap", 5), ("unreadable", 6)]
    for chunks in ([b"".join(text)], text, [text[0], b"".join(text[1:])]):
        assert [(row["kind"], row["line"]) for row in decode(*chunks).events] == expected
