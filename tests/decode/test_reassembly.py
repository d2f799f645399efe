"""Frames to transfers, by hand-written sequences, one case a test.

Every sequence runs between good transfers of the same session, which must come out whole whatever happens between.
"""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MS, SECOND, START, at, lines, push, retail, status, throttle

if TYPE_CHECKING:
    from collections.abc import Callable


ALLOCATION = {"node_id": 5, "first_part_of_unique_id": 1, "unique_id": [1, 2, 3]}
INFO = "uavcan.protocol.GetNodeInfo."


@pytest.fixture
def run(decode: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *parts, timed=True: decode(lines(*parts, timed=timed))


def brief(got: Any) -> list[tuple[int, str, list[int]]]:
    """(transfer id, status, frame numbers) of every transfer in the order of their first frames."""
    rows = [(row["transfer_id"], row["status"], row["frame"]) for row in got.transfers]
    return sorted(rows, key=lambda row: row[2][0])


def row_of(got: Any, first: int) -> dict[str, Any]:
    return next(row for row in got.transfers if row["frame"][0] == first)


@pytest.mark.parametrize(("make", "count"), [(status, 3), (push, 5)])
def test_one_lost_frame_is_one_broken_transfer(run: Any, make: Any, count: int) -> None:
    for lost in range(count):
        frames = make(5).frames()
        del frames[lost]
        got = run(make(4).frames(), frames, make(6).frames(), make(7).frames())
        good = [row for row in brief(got) if row[1] == "ok"]
        assert [row[0] for row in good] == [4, 6, 7]
        broken = [row for row in got.transfers if row["status"] != "ok"]
        rest = list(range(count, 2 * count - 1))
        if lost == 0:
            assert broken == []
            assert {got.verdicts[k] for k in rest} == {"orphan"}
        else:
            assert [(row["status"], row["frame"]) for row in broken] == [("interrupted", rest)]
            assert broken[0]["crc_here"] is None
            assert "abandoned" in broken[0]["anomaly"]
            assert ("toggle" in broken[0]["anomaly"]) == (lost < count - 1)
            assert {got.verdicts[k] for k in rest} == {"used"}
            marked = [k for k, row in enumerate(got.frames) if "toggle" in row["anomaly"]]
            assert marked == ([count + lost] if lost < count - 1 else [])
        carried = [got.message_of(row) for row in range(len(got.transfers))]
        assert [found is not None for found in carried] == [row["status"] == "ok" for row in got.transfers]


@pytest.mark.parametrize(("make", "count"), [(status, 3), (push, 5)])
def test_a_repeated_frame_is_dropped(run: Any, make: Any, count: int) -> None:
    for again in range(count):
        frames = make(5).frames()
        frames.insert(again, frames[again])
        got = run(make(4).frames(), frames, make(6).frames())
        assert [(row["transfer_id"], row["status"]) for row in got.transfers] == [(4, "ok"), (5, "ok"), (6, "ok")]
        assert [k for k, verdict in enumerate(got.verdicts) if verdict == "duplicate"] == [count + again + 1]
        assert got.transfers[1]["payload"] == make(5).payload
        # Once it is complete, a transfer is handed on, so a late copy of its last frame cannot mark it.
        assert ("duplicate frame" in got.transfers[1]["anomaly"]) == (again < count - 1)
        assert [row["step"] for row in got.transfers] == [None, 1, 1]


def test_a_copy_of_another_frame_is_no_duplicate(run: Any) -> None:
    a, b, c = status(5).frames()
    got = run(status(4).frames(), a, b, a, b, c, status(6).frames())
    assert brief(got) == [
        (4, "ok", [0, 1, 2]), (5, "interrupted", [3, 4]), (5, "ok", [5, 6, 7]), (6, "ok", [8, 9, 10]),
    ]  # fmt: skip


def test_two_frames_swapped(run: Any) -> None:
    a, b, c, d, e = push(5).frames()
    got = run(push(4).frames(), a, c, b, d, e, push(6).frames())
    assert brief(got) == [(4, "ok", [0, 1, 2, 3, 4]), (5, "interrupted", [5, 6, 7, 8, 9]), (6, "ok", [*range(10, 15)])]
    assert {"toggle", "abandoned"} <= got.transfers[1]["anomaly"]


def test_the_last_two_frames_swapped(run: Any) -> None:
    a, b, c = status(5).frames()
    got = run(status(4).frames(), a, c, b, status(6).frames())
    assert brief(got) == [(4, "ok", [0, 1, 2]), (5, "interrupted", [3, 4]), (6, "ok", [6, 7, 8])]
    assert got.verdicts[5] == "orphan"


def test_a_wrong_toggle_poisons_the_rest(run: Any) -> None:
    frames = push(5).frames()
    frames[2] = retail(frames[2], 0x20)
    got = run(push(4).frames(), frames, push(6).frames())
    assert brief(got)[1] == (5, "interrupted", [5, 6, 7, 8, 9])
    assert got.transfers[1]["crc_here"] is None
    assert "toggle" in got.frames[7]["anomaly"]
    assert "crc" not in got.transfers[1]["anomaly"]


def test_a_start_with_toggle_1_is_refused(run: Any) -> None:
    frames = [retail(frame, 0x20) for frame in status(5).frames()]
    got = run(status(4).frames(), frames, status(6).frames(), status(7).frames())
    assert got.verdicts == ["used"] * 3 + ["wrong toggle"] * 3 + ["used"] * 6
    assert "start toggle" in got.frames[3]["anomaly"]
    assert [row["transfer_id"] for row in got.transfers] == [4, 6, 7]


def test_a_single_frame_with_toggle_1_is_decoded(run: Any) -> None:
    got = run(throttle(4).frames(), retail(throttle(5).frames()[0], 0x20), throttle(6).frames())
    assert [row["status"] for row in got.transfers] == ["ok"] * 3
    assert [row["anomaly"] for row in got.transfers] == [set(), {"single toggle"}, set()]
    assert len(got.messages["RawCommand"]) == 3


@pytest.mark.parametrize("count", [2, 3])
def test_interleaved_transfers_are_all_delivered(run: Any, count: int) -> None:
    ways = [status(5 + k, rpm=k).frames() for k in range(count)]
    mixed = [way[step] for step in range(3) for way in ways]
    got = run(status(4).frames(), mixed, status(5 + count).frames())
    assert [row["status"] for row in got.transfers] == ["ok"] * (count + 2)
    assert [row["transfer_id"] for row in got.transfers] == list(range(4, 6 + count))
    assert [row["rpm"] for row in got.messages["ESCStatus"]] == [-5, *range(count), -5]
    assert ["interleaved" in row["anomaly"] for row in got.transfers] == [False, *[True] * count, False]


def test_a_single_frame_between_the_frames_of_another(run: Any) -> None:
    a, b, c = encode.transfer("RawCommand", {"cmd": [1] * 8}, 1, 5).frames()
    got = run(throttle(4).frames(), a, throttle(6).frames(), b, c, throttle(7).frames())
    assert brief(got) == [(4, "ok", [0]), (5, "ok", [1, 3, 4]), (6, "ok", [2]), (7, "ok", [5])]
    assert "interleaved" in row_of(got, 1)["anomaly"]


def test_a_frame_with_another_transfer_id_is_no_part(run: Any) -> None:
    a, b, c = status(5).frames()
    got = run(status(4).frames(), a, retail(b, 5 ^ 9), b, c, status(6).frames())
    assert got.verdicts[4] == "wrong transfer id"
    assert brief(got)[1] == (5, "ok", [3, 5, 6])


def test_given_up_and_sent_anew(run: Any) -> None:
    got = run(push(4).frames(), push(5).frames()[:2], push(5).frames(), push(6).frames())
    assert [row[:2] for row in brief(got)] == [(4, "ok"), (5, "interrupted"), (5, "ok"), (6, "ok")]
    assert [row["step"] for row in got.transfers] == [None, 1, 1, 1]
    assert "abandoned" in got.transfers[1]["anomaly"]
    assert not got.transfers[2]["anomaly"]


def test_a_transfer_left_behind_by_later_ones(run: Any) -> None:
    got = run(status(4).frames(), status(5).frames()[:2], status(6).frames(), status(7).frames())
    assert brief(got)[1] == (5, "interrupted", [3, 4])


@pytest.mark.parametrize("late", [0, 1])
def test_the_timeout_is_two_seconds_to_the_nanosecond(run: Any, late: int) -> None:
    a, b, c = status(5).frames()
    first = START + 10 * MS
    after = [replace(f, t=first + 3 * SECOND + k * MS) for k, f in enumerate(status(6).frames())]
    got = run(status(4).frames(), replace(a, t=first), b, replace(c, t=first + 2 * SECOND + late), after)
    one = row_of(got, 3)
    if late:
        assert (one["status"], one["frame"]) == ("timed out", [3, 4])
        assert got.verdicts[5] == "orphan"
        assert {"timeout", "abandoned"} & one["anomaly"] == {"timeout"}
    else:
        assert (one["status"], one["frame"]) == ("ok", [3, 4, 5])
        assert one["anomaly"] == {"slow", "pause"}
    assert row_of(got, 6)["status"] == "ok"


def test_the_timeout_counts_from_the_start_not_from_the_last_frame(run: Any) -> None:
    frames = push(5).frames()
    slow = [at(SECOND + k * 600 * MS, frame) for k, frame in enumerate(frames)]  # the last one after 2.4 s
    got = run(push(4).frames(), slow)
    assert brief(got)[1] == (5, "timed out", [5, 6, 7, 8])
    assert got.verdicts[9] == "orphan"


def test_a_silent_session_times_out_without_frames_of_its_own(run: Any) -> None:
    other = [at(SECOND + k * 100 * MS, throttle(k % 32).frames()[0]) for k in range(60)]
    got = run(status(4).frames(), status(5).frames()[:2], other)
    one = row_of(got, 3)
    assert one["status"] == "timed out"
    order = [row["frame"][0] for row in got.transfers]
    assert order.index(3) < len(order) - 10  # found out on the way, not at the end


@pytest.mark.parametrize(("last", "state"), [(2 * SECOND, "open"), (2 * SECOND + 1, "timed out")])
def test_open_at_the_end(run: Any, last: int, state: str) -> None:
    first = START + 10 * MS
    other = [replace(throttle(k).frames()[0], t=first + k * last // 2) for k in range(3)]
    got = run(status(4).frames(), replace(status(5).frames()[0], t=first), other)
    one = row_of(got, 3)
    assert (one["status"], one["frame"], one["t"], one["t_end"]) == (state, [3], first, first)
    assert ("cut by end" in one["anomaly"]) == (state == "open")


def test_a_broken_transfer_at_the_end_is_interrupted(run: Any) -> None:
    a, b, *_ = push(5).frames()
    got = run(push(4).frames(), a, retail(b, 0x20))
    assert brief(got)[1] == (5, "interrupted", [5, 6])


def test_priority_is_compared_but_no_key(run: Any) -> None:
    frames = status(5).frames()
    frames[1] = replace(frames[1], id=frames[1].id & 0xFFFFFF | 3 << 24)
    got = run(status(4).frames(), frames, status(6, priority=16).frames())
    assert [row["status"] for row in got.transfers] == ["ok"] * 3
    assert [row["anomaly"] for row in got.transfers] == [set(), {"priority changed"}, set()]
    assert [row["priority"] for row in got.transfers] == [31, 31, 16]
    assert [row["step"] for row in got.transfers] == [None, 1, 1]


def test_an_anonymous_transfer_is_a_single_frame(run: Any) -> None:
    name = "uavcan.protocol.dynamic_node_id.Allocation"
    asks = [encode.transfer(name, ALLOCATION, 0, k, kind="anonymous") for k in range(5)]
    long = replace(asks[0], payload=bytes(12)).frames()
    long = [replace(frame, id=asks[0].can_id) for frame in long]
    got = run([f for ask in asks for f in ask.frames()], long)
    assert got.verdicts == ["used"] * 5 + ["anonymous multi"] * len(long)
    assert {(row["kind"], row["src"], row["step"], row["gap"]) for row in got.transfers} == {
        ("anonymous", 0, None, None)
    }
    assert [row["unique_id"] for row in got.messages[name]] == [[1, 2, 3]] * 5


def test_anonymous_transfers_may_repeat_their_id(run: Any) -> None:
    ask = encode.transfer("uavcan.protocol.dynamic_node_id.Allocation", ALLOCATION, 0, 7, kind="anonymous")
    got = run(*[ask.frames()] * 5)
    assert [row["anomaly"] for row in got.transfers] == [set()] * 5


def test_requests_and_responses_are_sessions_of_their_own(run: Any) -> None:
    ask = [encode.transfer(INFO + "Request", {}, 1, k, dst=10) for k in (3, 4)]
    empty = {"major": 1, "minor": 0, "unique_id": [0] * 16, "certificate_of_authenticity": []}
    part = {"uptime_sec": 1, "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}
    software = {"major": 1, "minor": 0, "optional_field_flags": 0, "vcs_commit": 0, "image_crc": 0}
    info = {"status": part, "software_version": software, "hardware_version": empty, "name": list(b"x")}
    answer = [encode.transfer(INFO + "Response", info, 10, k, dst=1) for k in (3, 4)]
    back = encode.transfer(INFO + "Request", {}, 10, 9, dst=1)
    got = run(*(f for pair in zip(ask, answer, strict=True) for one in pair for f in one.frames()), back.frames())
    in_order = sorted(got.transfers, key=itemgetter("frame"))  # a lone request is held until its node has spoken
    seen = [tuple(row[name] for name in ("kind", "src", "dst", "transfer_id", "step")) for row in in_order]
    assert seen == [
        ("request", 1, 10, 3, None), ("response", 10, 1, 3, None), ("request", 1, 10, 4, 1), ("response", 10, 1, 4, 1),
        ("request", 10, 1, 9, None),
    ]  # fmt: skip
    assert [row["dst"] for row in got.messages[INFO + "Response"]] == [1, 1]
    assert len(got.messages[INFO + "Request"]) == 3


@pytest.mark.parametrize(
    ("src", "dst", "anomaly"),
    [(1, 0, {"destination zero"}), (0, 1, {"source zero"}), (9, 9, {"addressed to itself"}),
     (0, 0, {"destination zero", "source zero", "addressed to itself"})],
)  # fmt: skip
def test_service_identifiers_that_nobody_may_send(run: Any, src: int, dst: int, anomaly: set[str]) -> None:
    asks = [encode.transfer(INFO + "Request", {}, src, k, dst=dst).frames()[0] for k in range(4)]
    got = run(asks)
    assert [row["anomaly"] for row in got.transfers] == [anomaly] * 4


def test_can_fd_padding_stays_in_the_transfer(run: Any) -> None:
    sent = [replace(push(k, 70 + k), fd=True) for k in range(3)]
    got = run([f for one in sent for f in one.frames()])
    assert [row["status"] for row in got.transfers] == ["ok"] * 3
    assert [row["payload"] for row in got.transfers] == [one.padded for one in sent]
    assert {row["fd"] for row in got.transfers} == {True}
    assert [row["anomaly"] for row in got.transfers] == [{"can fd"}] * 3


def test_a_frame_without_data_has_no_tail(run: Any) -> None:
    bare = replace(status(5).frames()[0], data=b"")
    a, b, c = status(5).frames()
    got = run(status(4).frames(), a, bare, b, replace(bare, remote=True, dlc=8), c)
    assert [k for k, verdict in enumerate(got.verdicts) if verdict == "no tail"] == [4, 6]
    assert [got.frames[k]["anomaly"] for k in (4, 6)] == [{"no tail"}, {"remote"}]
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]


def test_one_bus_knows_nothing_of_another(run: Any) -> None:
    one, two = status(5).frames(), status(5, 9).frames(bus="can1")
    good = status(4).frames(bus="can1")
    got = run(status(4).frames(), good, [f for pair in zip(one, two, strict=True) for f in pair])
    assert [(row["bus"], row["status"], row["anomaly"]) for row in got.transfers] == [
        (0, "ok", set()), (1, "ok", set()), (0, "ok", set()), (1, "ok", set()),
    ]  # fmt: skip
    assert got.engine.buses == ("can0", "can1")


def test_without_time_stamps_nothing_times_out(run: Any) -> None:
    frames = push(5).frames()
    got = run(push(4).frames(), frames[:2], throttle(1).frames() * 50, frames[2:], push(6).frames(), timed=False)
    mine = [row for row in got.transfers if row["src"] == 10]
    assert [row["status"] for row in mine] == ["ok"] * 3
    assert {(row["t"], row["t_end"], row["gap"]) for row in mine} == {(None, None, None)}
    assert [row["step"] for row in mine] == [None, 1, 1]
