"""Senders without a node ID: what names its type in full is theirs, all else from source 0 is anonymous or foreign."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.encode import Frame, Transfer
from kit.judged import Said, whole
from kit.traffic import ALIVE, MS, alive, at, lines, push, status, tail, throttle

if TYPE_CHECKING:
    from collections.abc import Callable

ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"


@pytest.fixture
def run(decode: Callable[..., Any], flush: object) -> Callable[..., Any]:
    """In one piece, and the same line by line."""

    def both(*parts: Any) -> Any:
        log = lines(*parts)
        got = decode(log)
        cut = decode(*(piece for line in log.splitlines(keepends=True) for piece in (line, flush)))
        assert cut.frames == got.frames
        assert by_frame(cut) == by_frame(got)
        return got

    return both


def by_frame(got: Any) -> list[tuple[Any, ...]]:
    rows = ((row["frame"], row["kind"], row["type_id"], row["src"], row["status"]) for row in got.transfers)
    return sorted(rows)


def nameless(sent: Transfer) -> list[Frame]:
    return replace(sent, src=0).frames()


def beats(*ids: int) -> list[Frame]:
    """NodeStatus of a sender without a node ID, a frame each."""
    return [frame for k in ids for frame in nameless(alive(k, transfer_id=k))]


def asks(*ids: int, number: Callable[[int], int] | None = None) -> list[Frame]:
    """Requests for a node ID; `number` gives other discriminators than those that come from the payload."""
    found = []
    for k in ids:
        fields = {"node_id": 0, "first_part_of_unique_id": 1, "unique_id": [k, 2 * k, 3]}
        (frame,) = encode.transfer(ALLOCATION, fields, 0, k, kind="anonymous").frames()
        found.append(frame if number is None else replace(frame, id=frame.id & ~0xFF_FC00 | number(k) << 10))
    return found


def said(text: bytes, *rules: str) -> list[Said]:
    return whole(text, rules)


def test_a_good_crc_is_a_sender(run: Any) -> None:
    got = run(nameless(status(4)))
    assert got.verdicts == ["used"] * 3
    (row,) = got.transfers
    assert (row["kind"], row["type_id"], row["src"], row["status"]) == ("message", 1034, 0, "ok")
    assert [row["rpm"] for row in got.messages["ESCStatus"]] == [-5]


def test_a_wrong_crc_is_none(run: Any) -> None:
    first, *rest = nameless(status(4))
    bad = replace(first, data=bytes([first.data[0] ^ 1, *first.data[1:]]))
    got = run([bad, *rest])
    assert (got.verdicts, got.transfers) == (["foreign"] * 3, [])


@pytest.mark.parametrize(("ids", "found"), [((30, 31, 0), 3), ((5, 6, 7, 9), 4), ((5, 7, 9, 11), 0), ((5, 6), 0)])
def test_single_frames_in_sequence_are_a_sender(run: Any, ids: tuple[int, ...], found: int) -> None:
    sent = [frame for k in ids for frame in nameless(throttle(k))]
    got = run(sent)
    assert got.verdicts == (["used"] if found else ["foreign"]) * len(ids)
    assert [(row["kind"], row["src"]) for row in got.transfers] == [("message", 0)] * found
    assert len(got.messages.get("RawCommand", [])) == found


def test_one_frame_is_enough_of_a_sender_that_is_known(run: Any) -> None:
    got = run(nameless(status(4)), nameless(throttle(9)))
    assert got.verdicts == ["used"] * 4


def test_a_node_status_is_no_request_for_a_node_id(run: Any) -> None:
    """Though its type ends in the bits that an anonymous message has for that."""
    got = run(beats(3, 4, 5))
    assert [row["uptime_sec"] for row in got.messages[ALIVE]] == [3, 4, 5]
    assert ALLOCATION not in got.messages


def test_requests_for_a_node_id_stay_what_they_are(run: Any) -> None:
    """Their discriminators read as a known type in every variety: from the payload, constant, or drawn."""
    node_status, esc_parameters = 341 >> 2, 1033 >> 2
    for number in (None, lambda _: 7, lambda k: (node_status, 77, esc_parameters, 5, 900)[k % 5]):
        got = run(asks(*range(5), number=number))
        assert [row["kind"] for row in got.transfers] == ["anonymous"] * 5
        assert len(got.messages[ALLOCATION]) == 5
        assert set(got.verdicts) == {"used"}


def test_a_discriminator_from_the_payload_is_no_type(run: Any) -> None:
    """One request in some hundred has bits that read as a known type, and repeats them."""
    wanted = {341 >> 2, 1033 >> 2, 1061 >> 2, 1029 >> 2}
    numbers = random.Random(8)
    while True:
        fields = {"node_id": 0, "first_part_of_unique_id": 1, "unique_id": list(numbers.randbytes(6))}
        ask = encode.transfer(ALLOCATION, fields, 0, 0, kind="anonymous")
        if ask.can_id >> 10 & 0x3FFF in wanted:
            break
    got = run([replace(ask, transfer_id=k).frames()[0] for k in range(6)])
    assert [row["kind"] for row in got.transfers] == ["anonymous"] * 6


def test_senders_and_requests_on_one_bus(run: Any) -> None:
    mixed = [f for k in range(6) for f in (*nameless(status(k)), *asks(k), *beats(k), *nameless(push(k)))]
    got = run(mixed)
    assert set(got.verdicts) == {"used"}
    assert [len(got.messages[name]) for name in ("ESCStatus", "PUSHCAN", ALIVE, ALLOCATION)] == [6] * 4


@pytest.mark.parametrize("last", [0x00, 0x29, 0xC3, 0xFF, 0x80])
@pytest.mark.parametrize("type_id", [1030, 1034, 1332, 4, 5, 9])
def test_foreign_frames_that_end_in_00(run: Any, type_id: int, last: int) -> None:
    """A VESC or a J1939 engine of number 0, whatever the rest of the identifier says."""
    got = run([Frame(0x18 << 24 | type_id << 8, bytes([k, 1, 2, 3, 4, 5, 6, last])) for k in range(80)])
    assert not [row for row in got.transfers if row["kind"] == "message"]


def test_one_foreign_frame_is_no_sender(run: Any) -> None:
    for type_id in (1030, 1034, 1332):
        got = run([Frame(type_id << 8, bytes([7, 0xC3]))])
        assert (got.verdicts, got.transfers) == (["foreign"], [])


def test_noise_that_ends_in_00(run: Any) -> None:
    numbers = random.Random(12)
    frames = [Frame(numbers.choice((1030, 1034, 1039)) << 8, numbers.randbytes(8)) for _ in range(600)]
    got = run(frames)
    assert len(got.transfers) <= 6  # a few of thousand look like a transfer
    assert all(row["status"] != "ok" or len(row["frame"]) == 1 for row in got.transfers)


def test_an_unknown_type_is_no_sender(run: Any) -> None:
    got = run([Frame(999 << 8, bytes([k, 0xC0 | k])) for k in range(9)])
    assert got.transfers == []


def test_sender_and_foreign_frames_of_one_identifier(run: Any) -> None:
    """What did not prove itself is foreign for good, what does is there."""
    junk = [Frame(1034 << 8, bytes([k, 2, 3, 4, 5, 6, 7, 0x04])) for k in range(40)]
    got = run(junk, nameless(status(4)))
    assert [row["status"] for row in got.transfers] == ["ok"]
    assert got.verdicts[:16] == ["foreign"] * 16


def test_each_sender_without_a_node_id_is_said() -> None:
    frames = [f for k in range(4) for f in (*nameless(status(k)), *nameless(throttle(k)))]
    found = {one.type: one for one in said(lines(frames), "CAN-009")}
    assert {name: (one.severity, one.node, one.count, one.text) for name, one in found.items()} == {
        "ESCStatus": ("error", 0, 4, "3 frames of type 1034 from source 0"),
        "RawCommand": ("error", 0, 4, "1 frame of type 1030 from source 0"),
    }


def test_an_anonymous_message_is_no_fault() -> None:
    named = [f for k in range(4) for f in status(k).frames()]
    assert said(lines(named, asks(*range(5))), "CAN-009") == []
    one = said(lines(named, asks(*range(5)), tail(asks(0)[0], 0x80)), "CAN-009")
    assert [(of.count, of.text) for of in one] == [(1, "tail byte 80 from source 0")]


def test_what_a_sender_without_a_node_id_breaks_is_found() -> None:
    """A frame that is lost, one without a start, and a copy: as of any node, and of no other type."""
    good = [nameless(status(k)) for k in range(12)]
    good[4].pop(1)
    good[6].pop(0)
    good[8].insert(1, good[8][0])
    other = [f for k in range(12) for f in nameless(throttle(k))]
    frames = [f for k, part in enumerate(good) for f in (*part, other[k])]
    found = [(one.rule, one.node, one.type) for one in said(lines(frames), "TRF-003", "TRF-004", "TRF-005", "CAN-018")]
    assert sorted(found) == [("TRF-003", 0, "ESCStatus"), ("TRF-004", 0, "ESCStatus"), ("TRF-005", 0, "ESCStatus")]


def test_slow_senders_beside_a_fast_stranger() -> None:
    """The stranger's identifier ends like theirs, and its frames are many before the sender is told."""
    slow = [at(k * 5000 * MS, beats(k)[0]) for k in range(4)]
    fast = [at(k * 5 * MS, Frame(0x18FEF100, bytes([k % 256] * 7 + [0xFF]))) for k in range(4000)]
    text = lines(sorted([*slow, *fast], key=lambda frame: frame.t))
    assert {one.text.split()[1] for one in said(text, "CAN-018")} == {"18FEF100,"}
    assert [one.count for one in said(text, "CAN-009")] == [4]
