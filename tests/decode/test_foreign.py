"""Whose traffic is it? Other protocols on the bus never become messages, DroneCAN that proves itself always does."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.encode import Frame, Transfer
from kit.traffic import MS, SECOND, START, at, lines, push, retail, status, tail, throttle

if TYPE_CHECKING:
    from collections.abc import Callable

UNKNOWN = 999


@pytest.fixture
def run(decode: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *parts: decode(lines(*parts))


def unknown(transfer_id: int, size: int = 3, signature: int = 0x0123456789ABCDEF) -> Transfer:
    return Transfer(
        "message", UNKNOWN, 30, bytes((transfer_id * 7 + k) % 256 for k in range(size)), signature, transfer_id
    )


def all_foreign(got: Any) -> None:
    assert set(got.verdicts) == {"foreign"}
    assert got.transfers == []
    assert got.messages == {}


@pytest.mark.parametrize("last", [0x00, 0x21, 0xC0, 0xFF])
def test_standard_frames(run: Any, last: int) -> None:
    all_foreign(run([Frame(0x401, bytes([k, 0, 0x98, last]), extended=False) for k in range(40)]))


def test_standard_frames_that_count_like_transfers(run: Any) -> None:
    all_foreign(run([Frame(0x406, bytes([1, 0xC0 | k]), extended=False) for k in range(32)]))


# Priority, group and source of some J1939 messages; 1 to 3 are groups that read as data types somebody knows.
J1939 = [0x0CF00400, 0x18F00417, 0x18FEF100, 0x18FEEE00, 0x18FECA0B, 0x0C000003, 0x18EAFFF9, 0x18ECFF21, 0x18EBFF21]


@pytest.mark.parametrize("can_id", J1939)
@pytest.mark.parametrize("last", [0x00, 0x7D, 0xFF])
def test_j1939(run: Any, can_id: int, last: int) -> None:
    got = run([Frame(can_id, bytes([0xF0, 0x7D, k, 0x13, 0, 0, 0xFF, last])) for k in range(100)])
    all_foreign(got)


def test_j1939_whose_last_byte_is_never_filled(run: Any) -> None:
    ids = [
        priority << 24 | group << 8 | source
        for priority in (12, 24)
        for group in (0xF004, 0xFEF1)
        for source in range(256)
    ]
    got = run([Frame(can_id, bytes([k, 1, 2, 3, 4, 5, 6, 0xFF])) for k in range(20) for can_id in ids])
    all_foreign(got)


@pytest.mark.parametrize("last", [0x00, 0x04, 0x29, 0xF2])
def test_vesc_with_constant_last_bytes(run: Any, last: int) -> None:
    ids = [command << 8 | node for command in (9, 14, 15, 16, 27, 58) for node in (4, 85)]
    got = run([Frame(can_id, bytes([0, 0, k, 0, 1, 0, 0, last])) for k in range(80) for can_id in ids])
    all_foreign(got)


@pytest.mark.slow
def test_vesc_with_changing_last_bytes(run: Any) -> None:
    """The low byte of a current that wanders: a few identifiers in thousand may look like a run of transfer ids."""
    numbers, frames, count = random.Random(33), [], 500
    ids = [numbers.randrange(20, 256) << 8 | numbers.randrange(1, 128) for _ in range(count)]
    for _ in range(80):
        frames += [Frame(can_id, numbers.randbytes(8)) for can_id in ids]
    got = run(frames)
    believed = {(row["type_id"], row["src"]) for row in got.transfers}
    assert len(believed) <= count // 50, believed
    assert all(row["status"] != "ok" for row in got.transfers if row["crc_wire"] is not None)


def test_the_tunnel_of_a_vesc(run: Any) -> None:
    """Commands 5 to 7 carry an offset in front and whatever follows behind."""
    numbers = random.Random(4)
    frames = [Frame(0x503, bytes([7 * k % 256]) + numbers.randbytes(6) + b"\0") for k in range(60)]
    all_foreign(run(frames, Frame(0x703, bytes.fromhex("0401004953F2"))))


@pytest.mark.parametrize("type_id", [7509, 1030, 341, 1034])
@pytest.mark.parametrize("count", [4, 100])
@pytest.mark.parametrize("frames_each", [1, 2, 3])
def test_cyphal(run: Any, type_id: int, count: int, frames_each: int) -> None:
    ends = frames_each - 1
    frames = []
    for number in range(count):
        for k in range(frames_each):
            byte = (k == 0) << 7 | (k == ends) << 6 | (k % 2 == 0) << 5 | number % 32
            frames.append(Frame(0x10 << 24 | type_id << 8 | 42, bytes([number % 256, k, 1, 2, 3, 4, 5, byte])))
    got = run(frames)
    all_foreign(got)
    assert sum("cyphal" in row["anomaly"] for row in got.frames) == 1  # one note an identifier


@pytest.mark.parametrize("size", [3, 20])
def test_three_rising_ids_prove_an_unknown_type(run: Any, size: int) -> None:
    got = run([f for k in (30, 31, 0, 1, 2) for f in replace(unknown(k), payload=bytes([k]) * size).frames()])
    assert set(got.verdicts) == {"used"}
    assert [(row["transfer_id"], row["status"], row["step"]) for row in got.transfers] == [
        (30, "unchecked", None), (31, "unchecked", 1), (0, "unchecked", 1), (1, "unchecked", 1), (2, "unchecked", 1),
    ]  # fmt: skip
    assert [row["payload"] for row in got.transfers] == [bytes([k]) * size for k in (30, 31, 0, 1, 2)]
    assert {row["crc_here"] for row in got.transfers} == {None}
    assert ({row["crc_wire"] for row in got.transfers} == {None}) == (size == 3)
    assert got.messages == {}


@pytest.mark.parametrize(
    ("ids", "proven"), [((5, 6), False), ((5, 6, 8), False), ((5, 6, 8, 9, 10), True), ((5, 7, 9), False)]
)
def test_the_run_must_be_of_three(run: Any, ids: tuple[int, ...], proven: bool) -> None:
    got = run(*(unknown(k).frames() for k in ids))
    if proven:
        assert [row["transfer_id"] for row in got.transfers] == list(ids)
        assert [row["frame"] for row in got.transfers] == [[k] for k in range(len(ids))]
        assert set(got.verdicts) == {"used"}
    else:
        all_foreign(got)


def test_anonymous_frames_are_one_session_whatever_their_discriminator(decode: Any, flush: Any) -> None:
    """So that four of them are a proof, and what follows is handed on at once."""
    name = "uavcan.protocol.dynamic_node_id.Allocation"
    fields = [{"node_id": 0, "first_part_of_unique_id": 1, "unique_id": [k, 2 * k]} for k in range(6)]
    asks = [encode.transfer(name, of, 0, k, kind="anonymous") for k, of in enumerate(fields)]
    assert len({ask.can_id for ask in asks}) == 6
    got = decode(lines([frame for ask in asks for frame in ask.frames()]), flush)
    assert [len(batch.transfers) for batch in got.batches] == [6, 0]
    assert [row["unique_id"] for row in got.messages[name]] == [of["unique_id"] for of in fields]


@pytest.mark.parametrize("flushed", [False, True])
def test_held_frames_are_settled_across_batches(decode: Any, flush: Any, flushed: bool) -> None:
    texts = [lines([at(k * MS, unknown(k).frames()[0])]) for k in range(4)]
    got = decode(*(part for text in texts for part in ((text, flush) if flushed else (text,))))
    assert set(got.verdicts) == {"used"}
    assert [row["frame"] for row in got.transfers] == [[0], [1], [2], [3]]
    early = [row for batch in got.batches for row in batch.settled.to_pylist()]
    assert len(early) == (2 if flushed else 0)


def test_one_crc_start_value_proves_an_unknown_type(run: Any) -> None:
    got = run(unknown(3, 20).frames(), unknown(9, 30).frames())
    assert [(row["transfer_id"], row["status"]) for row in got.transfers] == [(3, "unchecked"), (9, "unchecked")]
    assert set(got.verdicts) == {"used"}
    assert [row["crc_wire"] for row in got.transfers] == [unknown(3, 20).crc, unknown(9, 30).crc]


def test_two_crc_start_values_prove_nothing(run: Any) -> None:
    all_foreign(run(unknown(3, 20).frames(), unknown(9, 30, 0xFEDC).frames()))


def test_patience_ends(run: Any) -> None:
    """After 64 frames without a proof an unknown identifier is foreign for good."""
    junk = [tail(unknown(1).frames()[0], 0x00)] * 64
    all_foreign(run(junk, *[unknown(k).frames() for k in range(10)]))


def test_before_patience_ends(run: Any) -> None:
    junk = [tail(unknown(1).frames()[0], 0x00)] * 40
    got = run(junk, *[unknown(k).frames() for k in range(3)])
    assert got.verdicts == ["orphan"] * 40 + ["used"] * 3


def test_a_capture_that_starts_inside_a_transfer(run: Any) -> None:
    got = run(status(3).frames()[1:], status(4).frames(), status(5).frames())
    assert got.verdicts == ["orphan"] * 2 + ["used"] * 6
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]


@pytest.mark.parametrize("orphans", [1, 5, 11])
def test_a_capture_that_starts_inside_a_long_transfer(run: Any, orphans: int) -> None:
    late = push(3, 120).frames()[-orphans:]
    got = run(late, push(4).frames())
    assert got.verdicts == ["orphan"] * orphans + ["used"] * 5


@pytest.mark.parametrize("orphans", [*range(12, 20), 37])
def test_a_capture_that_starts_inside_a_very_long_transfer(run: Any, orphans: int) -> None:
    """Its rest looks foreign for a while, but the good transfers behind it are all there."""
    late = push(3, 255).frames()[-orphans:]
    got = run(late, push(4).frames(), push(5).frames())
    assert [(row["transfer_id"], row["status"]) for row in got.transfers] == [(4, "ok"), (5, "ok")]


def assert_found_again(got: Any, good: int) -> None:
    """What was held back when the proof came may read as orphans of the session."""
    assert got.verdicts[:16] + got.verdicts[40:] == ["foreign"] * 16 + ["used"] * good
    assert set(got.verdicts[16:40]) <= {"foreign", "orphan"}


@pytest.mark.parametrize("byte", [0x00, 0x21, 0x7F])
def test_a_known_type_id_in_other_hands(run: Any, byte: int) -> None:
    junk = [Frame(throttle(0).can_id, bytes([k, 2, 3, 4, 5, 6, 7, byte])) for k in range(40)]
    all_foreign(run(junk))
    got = run(junk, *[throttle(k).frames() for k in range(4, 10)])
    assert_found_again(got, 6)
    assert [row["cmd"] for row in got.messages["RawCommand"]] == [[100] * 4] * 6


def test_a_good_crc_ends_the_doubt_at_once(run: Any) -> None:
    junk = [Frame(status(0).can_id, bytes([k, 2, 3, 4, 5, 6, 7, 0x00])) for k in range(40)]
    got = run(junk, status(4).frames())
    assert_found_again(got, 3)
    assert [row["rpm"] for row in got.messages["ESCStatus"]] == [-5]


def test_trust_is_not_lost_again(run: Any) -> None:
    """Rubbish on a trusted session is an error of that session, to be shown, not somebody else's traffic."""
    junk = [tail(status(1).frames()[1], 0x0A)] * 100
    got = run(status(4).frames(), junk, status(5).frames())
    assert got.verdicts[:3] + got.verdicts[-3:] == ["used"] * 6
    assert set(got.verdicts[3:-3]) == {"orphan"}


def test_neighbours_do_not_prove_each_other(run: Any) -> None:
    """A node that speaks DroneCAN may still share the bus with identifiers that end like its own."""
    mine = [unknown(k).frames()[0] for k in range(5)]
    other = [Frame(0x18FECA00 | 30, bytes([k, 0, 0, 0xFF])) for k in range(40)]
    got = run(mine, other)
    assert got.verdicts == ["used"] * 5 + ["foreign"] * 40


def test_a_late_proof_does_not_depend_on_time(run: Any) -> None:
    frames = [at(k * 10 * SECOND, unknown(k).frames()[0]) for k in range(3)]
    got = run(frames)
    assert set(got.verdicts) == {"used"}
    assert [row["gap"] for row in got.transfers] == [None, 10 * SECOND, 10 * SECOND]
    assert got.transfers[0]["t"] == START


def test_a_single_good_frame_of_a_known_type_is_enough(run: Any) -> None:
    got = run(throttle(17).frames())
    assert (got.verdicts, got.transfers[0]["status"]) == (["used"], "ok")
    assert run(retail(throttle(17).frames()[0], 0x20)).verdicts == ["foreign"]  # that could as well be Cyphal


def test_frames_of_both_sorts_keep_their_order(run: Any) -> None:
    mixed = []
    for k in range(12):
        mixed += [throttle(k).frames()[0], unknown(k).frames()[0], Frame(0x18F00417, bytes([k] * 7) + b"\xff")]
    got = run(mixed)
    assert got.verdicts == ["used", "used", "foreign"] * 12
    by_type = {of: [row["transfer_id"] for row in got.transfers if row["type_id"] == of] for of in (1030, UNKNOWN)}
    assert by_type == {1030: list(range(12)), UNKNOWN: list(range(12))}
    assert UNKNOWN not in {of.type_id for of in encode.TYPES.values()}
