"""What is measured about a transfer beside its payload: CRCs, fill, steps, gaps, repetitions; one case a test."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MS, SECOND, START, at, lines, push, status, throttle

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.encode import Frame


@pytest.fixture
def run(decode: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *parts, timed=True: decode(lines(*parts, timed=timed))


def test_crc_is_that_of_signature_and_payload(run: Any) -> None:
    frames = status(5).frames()
    frames[1] = replace(frames[1], data=b"\xff" + frames[1].data[1:])
    got = run(status(4).frames(), frames)
    good, bad = got.transfers
    assert good["crc_wire"] == good["crc_here"] == status(4).crc
    whole = b"".join(frame.data[:-1] for frame in frames)
    start = encode.signature_crc(encode.TYPES["ESCStatus"].signature)
    assert (bad["crc_wire"], bad["crc_here"]) == (status(5).crc, encode.crc16(whole[2:], start))
    assert (bad["status"], bad["anomaly"]) == ("bad crc", {"crc"})
    assert [row["trusted"] for row in got.messages["ESCStatus"]] == [True, False]  # decoded, but marked


def split_by(sizes: tuple[int, ...], transfer_id: int = 5) -> list[Frame]:
    """The three-frame transfer cut at other places."""
    whole = b"".join(frame.data[:-1] for frame in status(transfer_id).frames())
    assert sum(sizes) == len(whole)
    out, last = [], len(sizes) - 1
    for k, size in enumerate(sizes):
        tail = (k == 0) << 7 | (k == last) << 6 | (k & 1) << 5 | transfer_id
        out.append(encode.Frame(status(transfer_id).can_id, whole[:size] + bytes([tail])))
        whole = whole[size:]
    return out


@pytest.mark.parametrize(
    ("sizes", "anomaly"),
    [
        ((7, 7, 2), set()),
        ((7, 7, 2, 0), {"frame not full", "last frame empty"}),
        ((7, 5, 4), {"frame not full"}),
        ((2, 7, 7), {"frame not full", "first frame too short"}),
        ((3, 7, 6), {"frame not full"}),
        ((0, 7, 7, 2), {"frame not full", "first frame too short"}),
        ((1, 7, 7, 1), {"frame not full", "first frame too short"}),
    ],
)
def test_frames_that_are_not_full(run: Any, sizes: tuple[int, ...], anomaly: set[str]) -> None:
    got = run(status(4).frames(), split_by(sizes), status(6).frames())
    assert [row["status"] for row in got.transfers] == ["ok"] * 3
    assert got.transfers[1]["anomaly"] == anomaly
    assert [row["rpm"] for row in got.messages["ESCStatus"]] == [-5] * 3


@pytest.mark.parametrize("sizes", [(0, 0), (1, 0), (0, 1)])
def test_too_short_for_a_crc(run: Any, sizes: tuple[int, int]) -> None:
    frames = [
        encode.Frame(status(5).can_id, bytes(size) + bytes([t])) for size, t in zip(sizes, (0x85, 0x65), strict=True)
    ]
    got = run(status(4).frames(), frames, status(6).frames())
    one = got.transfers[1]
    assert (one["status"], one["frame"], one["crc_wire"], one["payload"]) == ("too short", [3, 4], None, b"")
    assert len(got.messages["ESCStatus"]) == 2


def test_several_frames_for_what_one_can_hold(run: Any) -> None:
    short = throttle(5)
    body = encode.crc16(short.payload, encode.signature_crc(short.signature)).to_bytes(2, "little") + short.payload
    frames = [encode.Frame(short.can_id, body[:7] + b"\x85"), encode.Frame(short.can_id, body[7:] + b"\x65")]
    got = run(throttle(4).frames(), frames, throttle(6).frames())
    assert [(row["status"], row["anomaly"]) for row in got.transfers] == [
        ("ok", set()), ("ok", {"needless multi"}), ("ok", set()),
    ]  # fmt: skip


def test_step_and_gap_follow_the_session(run: Any) -> None:
    ids, times = (30, 31, 0, 1, 4, 2), (0, 2, 5, 9, 14, 20)
    sent = [replace(throttle(k).frames()[0], t=START + t * MS) for k, t in zip(ids, times, strict=True)]
    other = throttle(9).frames(START + 6 * MS)[0]
    got = run(*sent[:3], replace(other, id=other.id + 1), *sent[3:])
    mine = [row for row in got.transfers if row["src"] == 1]
    assert [row["step"] for row in mine] == [None, 1, 1, 1, 3, 30]
    assert [row["gap"] for row in mine] == [None, 2 * MS, 3 * MS, 4 * MS, 5 * MS, 6 * MS]
    assert [row["anomaly"] for row in mine] == [set()] * 4 + [{"transfer id gap"}] * 2


def test_gap_is_start_to_start(run: Any) -> None:
    got = run([at(k * MS, f) for k, f in enumerate(status(4).frames())], at(50 * MS, status(5).frames()[0]),
              status(5).frames()[1:])  # fmt: skip
    assert [row["gap"] for row in got.transfers] == [None, 50 * MS]


@pytest.mark.parametrize(("pause", "anomaly"), [(2 * SECOND, {"transfer id gap"}), (2 * SECOND + 1, set())])
def test_after_more_than_two_seconds_any_id_may_follow(run: Any, pause: int, anomaly: set[str]) -> None:
    first = throttle(4).frames(START)[0]
    got = run(first, replace(throttle(9, 7).frames()[0], t=START + pause))
    assert (got.transfers[1]["step"], got.transfers[1]["gap"]) == (5, pause)
    assert got.transfers[1]["anomaly"] == anomaly


@pytest.mark.parametrize("pause", [MS, 2 * SECOND, 2 * SECOND + 1])
@pytest.mark.parametrize("value", [100, 101])
@pytest.mark.parametrize("make", ["single", "multi"])
def test_a_repeated_transfer_id(run: Any, make: str, value: int, pause: int) -> None:
    first, second = (throttle(4), throttle(4, value)) if make == "single" else (status(4, 100), status(4, value))
    got = run(first.frames(START, MS), second.frames(START + 3 * MS + pause, MS))
    expected = {"duplicate"} if value == 100 else {"transfer id repeated"}
    late = 3 * MS + pause > 2 * SECOND
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]
    assert got.transfers[1]["anomaly"] == (set() if late else expected)
    assert got.transfers[1]["step"] == 0


def test_a_repeated_id_after_a_broken_transfer_is_not_called_a_duplicate(run: Any) -> None:
    broken = status(5).frames()
    del broken[1]
    got = run(status(4).frames(), broken, status(5).frames())
    assert [row["status"] for row in got.transfers] == ["ok", "interrupted", "ok"]
    assert "duplicate" not in got.transfers[2]["anomaly"]


@pytest.mark.parametrize(
    ("ids", "anomaly"), [((7, 0), {"transfer id restarted"}), ((31, 0), set()), ((7, 3), {"transfer id gap"})]
)
def test_a_node_that_restarts(run: Any, ids: tuple[int, int], anomaly: set[str]) -> None:
    got = run(*(throttle(k).frames() for k in ids))
    assert got.transfers[1]["anomaly"] == anomaly


def test_time_that_runs_backwards_breaks_nothing(run: Any) -> None:
    a, b, c = status(5).frames()
    got = run(status(4).frames(), at(SECOND, a), at(SECOND - 500 * MS, b), at(SECOND + MS, c))
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]
    assert [k for k, row in enumerate(got.frames) if "time backwards" in row["anomaly"]] == [4]


def test_slow_pause_and_long(run: Any) -> None:
    a, b, c = status(5).frames()
    got = run(status(4).frames(), at(SECOND, a), at(SECOND + 100 * MS, b), at(2 * SECOND, c))
    assert got.transfers[1]["anomaly"] == {"pause"}  # 1.0 s sharp
    got = run(status(4).frames(), at(SECOND, a), at(SECOND + 100 * MS, b), at(2 * SECOND + 1, c))
    assert got.transfers[1]["anomaly"] == {"pause", "slow"}
    for size, anomaly in ((1023, set()), (1024, {"long"})):
        got = run(replace(push(4), payload=bytes(size)).frames())
        assert got.transfers[0]["anomaly"] == anomaly
