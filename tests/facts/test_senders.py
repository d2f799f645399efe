"""Facts of nodes: what they are, what is missing of what they sent, restarts, and how they differ from others."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES
from kit.encode import Transfer, log_line, transfer
from kit.traffic import START, TURNING, Timed, alive, log, status, throttle

from analyzer.facts.summary import Summary

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.facts.senders import SenderFacts
    from dissectors import Registry

Facts = dict[tuple[str, int], "SenderFacts"]


@pytest.fixture
def senders(decode: Callable[..., Any], registry: Registry) -> Callable[..., Facts]:
    def found(*text: Any) -> Facts:
        got = decode(*(piece.encode() if isinstance(piece, str) else piece for piece in text))
        summary = Summary(registry)
        for batch in got.batches:
            summary.feed(batch)
        return {(one.bus, one.node): one for one in summary.finish([], got.engine).senders}

    return found


def esc(node: int, channel: int, transfer_id: int) -> Transfer:
    return transfer("ESCStatus", TURNING | {"esc_index": channel - 1}, node, transfer_id)


def reports(node: int, ids: Sequence[int], channel: int = 0, every: float = 20) -> list[Timed]:
    return [(every * k, esc(node, channel or node - 10, number % 32)) for k, number in enumerate(ids)]


def test_roles_channels_and_rates(senders: Callable[..., Facts]) -> None:
    text = log(*reports(11, range(51)), *((10.0 * k, throttle(k % 32)) for k in range(101)))
    found = senders(text)
    assert {(one.node, one.roles, one.channels, one.types, one.count) for one in found.values()} == {
        (1, ("autopilot",), (), 1, 101), (11, ("ESC",), (1,), 1, 51),
    }  # fmt: skip
    assert found["can0", 11].hz == pytest.approx(50)
    assert found["can0", 1].hz == pytest.approx(100)


@pytest.mark.parametrize(("count", "hz"), [(1, None), (2, None), (3, None), (4, 50.0)])
def test_few_transfers_are_no_rate(count: int, hz: float | None, senders: Callable[..., Facts]) -> None:
    (one,) = senders(log(*reports(11, range(count)))).values()
    assert (one.count, one.hz) == (count, None if hz is None else pytest.approx(hz))


def interleaved(offset: int, often: int = 2) -> list[Timed]:
    """Reports of two devices, the other one with IDs `offset` ahead and once in so many times."""
    return [
        sent
        for k in range(60)
        for sent in ((20.0 * k, esc(11, 1, k % 32)), (20.0 * k + 7, esc(11, 2, (k // often + offset) % 32)))
        if sent[0] == 20.0 * k or not k % often
    ]


@pytest.mark.parametrize("offset", [0, 1, 5, 16, 28, 31])
@pytest.mark.parametrize("often", [1, 2, 3])
@pytest.mark.parametrize("step", [None, 1, 7])
def test_losses_of_two_devices_with_one_node_id_cannot_be_counted(
    offset: int, often: int, step: int | None, senders: Callable[..., Facts]
) -> None:
    text = log(*interleaved(offset, often))
    rows = text.splitlines(keepends=True)
    pieces = ["".join(rows[k : k + step]) for k in range(0, len(rows), step)] if step else [text]
    (one,) = senders(*pieces).values()
    assert one.lost is None or (often == 1 and offset in (0, 1, 31) and one.lost <= 2)


def test_gaps_of_answers_alone_are_no_losses(senders: Callable[..., Facts]) -> None:
    """They have the transfer IDs of their requests."""
    sent = [(20.0 * k, Transfer("response", 11, 42, b"a", 0, 7 * k % 32, dst=10)) for k in range(8)]
    (one,) = senders(log(*sent)).values()
    assert (one.count, one.lost) == (8, 0)


def test_losses_of_one_device_can_be_counted(senders: Callable[..., Facts]) -> None:
    """Also where much is lost, at even distances, or comes in another order."""
    for ids in (
        [k for k in range(400) if k % 3],
        [k for k in range(400) if not k % 2],
        [*range(40), *range(60, 99)],
    ):
        uptimes = [(1.0, alive(3)), (900.0, alive(4, transfer_id=1))]
        (one,) = senders(log(*reports(11, ids), *uptimes)).values()
        assert one.lost == ids[-1] + 1 - ids[0] - len(ids)
    (one,) = senders(log(*reports(11, [k ^ 1 for k in range(64)]))).values()
    assert one.lost in (0, 1, 2)


def test_who_only_sends_types_without_definition_is_there(senders: Callable[..., Facts]) -> None:
    sent = [(20.0 * k, Transfer("message", 20_710, 30, b"ab", 0, k)) for k in range(8)]
    (one,) = senders(log(*sent)).values()
    assert (one.node, one.count, one.known, one.types, one.roles) == (30, 8, 0, 1, ())


@pytest.mark.parametrize(
    ("ids", "lost"),
    [
        (range(40), 0),
        ([0, 1, 2, 6, 7], 3),
        ([*range(30), *range(33, 40)], 3),
        ([5, 7, 6, 8], 0),
        ([5, 8, 6, 7, 9], 0),
        ([0, 1, 1, 2], 0),
        ([0, 1, 21], 19),
    ],
    ids=str,
)
def test_what_is_missing_by_transfer_ids(
    senders: Callable[..., Facts], flush: object, ids: Sequence[int], lost: int
) -> None:
    text = log(*reports(11, ids))
    assert senders(text)["can0", 11].lost == lost
    half = text.index("\n", len(text) // 2) + 1
    assert senders(text[:half], flush, text[half:])["can0", 11].lost == lost


def test_what_is_missing_before_an_id_of_0_is_no_restart(senders: Callable[..., Facts]) -> None:
    """Where the uptime runs on."""
    ids = [29, 30, 0, 1]
    running, fell = ([(0.0, alive(up)), (900.0, alive(to, transfer_id=1))] for up, to in ((9, 10), (9, 0)))
    for uptimes, lost in ((running, 1), (fell, 0), ([], 0)):
        assert senders(log(*reports(11, ids), *uptimes))["can0", 11].lost == lost


def test_a_session_after_silence_and_a_restart_lose_nothing(senders: Callable[..., Facts]) -> None:
    silent = [(0.0, esc(11, 1, 4)), (2500.0, esc(11, 1, 20))]
    restarted = [(20.0 * k, esc(12, 2, number)) for k, number in enumerate([9, 10, 0, 1])]
    found = senders(log(*silent, *restarted))
    assert [one.lost for one in found.values()] == [0, 0]


def test_a_clock_may_end_where_times_do(senders: Callable[..., Facts]) -> None:
    lines = log(*((1000 * k, alive(uptime, 11, k)) for k, uptime in enumerate((100, 101, 5, 6)))).splitlines()
    stamps = ("0.000000", "1.000000", "9223372036.500000", "9223372036.600000")
    moved = (f"({stamp}) {line.partition(' ')[2]}\n" for stamp, line in zip(stamps, lines, strict=True))
    assert senders("".join(moved))["can0", 11].restarts == 1


@pytest.mark.parametrize(
    ("uptimes", "restarts"),
    [([3, 4, 5], 0), ([300, 301, 0, 1], 1), ([300, 0, 1, 0], 2), ([3000, 2000, 3001, 2001], 0)],
    ids=str,
)
def test_restarts(senders: Callable[..., Facts], flush: object, uptimes: Sequence[int], restarts: int) -> None:
    """Two devices with one ID, whose uptimes both run on, are no restarts."""
    text = log(*((1000.0 * k, alive(up, transfer_id=k)) for k, up in enumerate(uptimes)), (5.0, esc(12, 2, 0)))
    rows = text.splitlines(keepends=True)
    pieces = [piece for row in rows for piece in (row, flush)]
    for found in (senders(text), senders(*pieces)):
        assert (found["can0", 11].restarts, found["can0", 12].restarts) == (restarts, None)


def test_the_text_of_a_version_stands_against_its_numbers(senders: Callable[..., Facts]) -> None:
    found = senders((CAPTURES / "mission-8-faults.log").read_bytes())
    assert {found["can0", node].software for node in range(11, 19)} == {"V2.2.0-20250314"}
    assert found["can0", 125].software == "2.2"
    assert found["can0", 11].name


def odd(found: Facts) -> dict[int, tuple[str, ...]]:
    return {one.node: one.odd for one in found.values() if one.odd}


def test_an_esc_that_is_like_the_others_is_not_odd(senders: Callable[..., Facts]) -> None:
    assert odd(senders((CAPTURES / "hover-4.log").read_bytes())) == {}


def test_what_is_odd(senders: Callable[..., Facts]) -> None:
    alike = [one for node in (11, 12, 13) for one in reports(node, range(300))]
    slow = reports(14, range(100), every=60)
    late = [(at + 3000, one) for at, one in reports(15, range(150))]
    gone = reports(16, range(100))
    lossy = reports(17, [*range(200), *range(203, 303)])
    twice = reports(18, range(300), channel=1)
    assert odd(senders(log(*alike, *slow, *late, *gone, *lossy, *twice))) == {
        11: ("channel shared",), 14: ("rate",), 15: ("came late",), 16: ("left early",), 17: ("lost",),
        18: ("channel shared",),
    }  # fmt: skip
    assert odd(senders(log(*reports(11, range(300)), *slow))) == {}, "two do not tell which is odd"


def test_another_firmware_is_odd(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(log(*(one for node in range(11, 15) for one in reports(node, range(20)))).encode())
    summary = Summary(registry)
    for batch in got.batches:
        summary.feed(batch)
    versions = {(0, 11): "V2.2.07", (0, 12): "V2.2.05", (0, 13): "V2.2.07", (0, 14): "2.2"}
    summary._senders.software.all.update(versions)
    assert {one.node: one.odd for one in summary.finish([], got.engine).senders if one.odd} == {12: ("software",)}


def test_broken_transfers_give_no_role(senders: Callable[..., Facts]) -> None:
    frames = status(0).frames(START)
    broken = [replace(frames[1], data=b"\xff" + frames[1].data[1:])]
    text = "".join(log_line(one) + "\n" for one in (frames[0], *broken, *frames[2:]))
    (one,) = senders(text).values()
    assert (one.roles, one.bad) == ((), 1)


def two_types(ids: Sequence[tuple[int, int]], uptimes: Callable[[int], int] = lambda k: 9 + k // 10) -> str:
    """Return a log of ESCStatus with the first IDs, each followed by a NodeStatus with the second."""
    sent = [
        one
        for k, (report, status_) in enumerate(ids)
        for one in ((100.0 * k, esc(11, 1, report % 32)), (100.0 * k + 50, alive(uptimes(k), transfer_id=status_ % 32)))
    ]
    return log(*sent)


@pytest.mark.parametrize("cut", [None, 40])
@pytest.mark.parametrize(
    ("ids", "lost"),
    [
        ([(2 * k, 2 * k + 1) for k in range(40)], 0),  # one counter for both: TRF-020
        ([(2 * k + 3 * (k > 20), 2 * k + 1 + 3 * (k > 20)) for k in range(40)], 3),
        ([(k, k) for k in range(20)] + [(0 + k, 0 + k) for k in range(20)], 0),  # both begin anew: TRF-019
        ([(k % 10, k) for k in range(64)], 0),  # one wraps early, more than twice
        ([(2 * k, k) for k in range(40)], 39),  # every other one of one type is missing
    ],
)
def test_gaps_of_one_counter_for_all_types_or_of_one_that_begins_anew_are_no_losses(
    senders: Callable[..., Facts], flush: object, ids: list[tuple[int, int]], lost: int, cut: int | None
) -> None:
    text = two_types(ids)
    if cut is None:
        assert senders(text)["can0", 11].lost == lost
        return
    half = text.index("\n", len(text) * cut // 100) + 1
    assert senders(text[:half], flush, text[half:])["can0", 11].lost == lost
