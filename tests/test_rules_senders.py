"""One node ID whose transfer IDs come from several counters, from one that skips, or from one that wraps early."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from encode import transfer
from judged import Said, whole
from sent import ALIVE, Sent, alive, log

if TYPE_CHECKING:
    from collections.abc import Sequence

IDS = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")
ARMING = "uavcan.equipment.safety.ArmingStatus"


def message(t: int, transfer_id: int, src: int = 11, status: int = 0, name: str = ALIVE) -> Sent:
    """One NodeStatus (or ArmingStatus) `t` ms into the capture."""
    if name == ALIVE:
        return t, alive(5, src, transfer_id, vendor_specific_status_code=status)
    return t, transfer(name, {"status": status & 1}, src, transfer_id)


def seen(*sent: Sent) -> list[Said]:
    return whole(log(*sent), IDS)


def several(offsets: Sequence[int], each: int = 24, *, lost: Sequence[int] = ()) -> list[Sent]:
    """As many senders behind node 11 as there are offsets, by turns; the transfers with these numbers are missing."""
    sent = [
        message(3000 + k * 100 + n * (90 // len(offsets)) + k * n % 3, (offset + k) % 32, status=k * 16 + n)
        for k in range(each) for n, offset in enumerate(offsets)
    ]  # fmt: skip
    return [message(0, 0, 99), *(one for k, one in enumerate(sent) if k not in lost)]


@pytest.mark.parametrize(
    ("offsets", "number"),
    [
        ((3, 3), "two"), ((3, 4), "two"), ((3, 19), "two"), ((5, 5, 5), "three"), ((0, 1, 2), "three"),
        ((0, 9, 18), "three"), ((9, 0, 9), "three"), ((0, 7, 14, 21), "four"), ((6, 6, 6, 6), "four"),
        ((0, 11, 22, 1, 12), "five"), (range(0, 48, 8), "six"), ([31] * 7, "seven"), (range(0, 40, 5), "eight"),
    ],
)  # fmt: skip
def test_up_to_eight_senders_are_one_finding_whatever_their_offsets(offsets: Sequence[int], number: str) -> None:
    (one,) = seen(*several(offsets))
    assert (one.rule, one.severity, one.node, one.type) == ("BUS-010", "error", 11, "")
    assert one.text.startswith(f"{number} transfer-ID counters in {ALIVE}, at ")
    assert one.text.count(" and ") == 1
    assert one.text.count(",") == len(offsets) - 1


def test_senders_of_which_transfers_are_lost_are_still_told_apart() -> None:
    (one,) = [one for one in seen(*several((0, 9, 18), lost=(20, 47))) if one.rule == "BUS-010"]
    assert one.text.startswith("three transfer-ID counters")


def test_all_places_are_those_of_the_counters() -> None:
    (one,) = seen(*several((0, 10, 20), each=8))
    assert one.text == f"three transfer-ID counters in {ALIVE}, at 26, 7 and 17"


@pytest.mark.parametrize(("every", "kept"), [(31, 30), (20, 16), (18, 4), (12, 8), (9, 4), (5, 3)])
def test_losses_at_regular_intervals_are_no_second_sender(every: int, kept: int) -> None:
    """By their IDs alone they would be: what is lost now comes after a round of 32."""
    sent = [message(3000 + k * 20, k % 32, status=k) for k in range(640) if k % every < kept]
    assert {one.rule for one in seen(message(0, 0, 99), *sent)} <= {"TRF-016", "TRF-019"}


@pytest.mark.parametrize("step", [2, 3, 5, 8, 30, 31])
def test_a_sender_that_skips_ids_is_no_second_one_and_does_not_restart(step: int) -> None:
    sent = [message(3000 + k * 50, k * step % 32, status=k) for k in range(80)]
    beside = [message(3020 + k * 50, (k * step + 7) % 32, name=ARMING, status=k // 7) for k in range(80)]
    assert {one.rule for one in seen(message(0, 0, 99), *sent, *beside)} == {"TRF-016"}


@pytest.mark.parametrize("top", [7, 15, 29, 30])
def test_a_counter_that_wraps_early_each_time_is_one_finding(top: int) -> None:
    """Of whatever types, and no restart: the uptime goes on."""
    wraps = top + 1
    sent = [(3000 + k * 40, alive(5 + k * 40 // 1000, 11, k % wraps)) for k in range(3 * wraps + 4)]
    beside = [message(3020 + k * 40, (k + 3) % wraps, name=ARMING, status=k // 7) for k in range(3 * wraps + 4)]
    (one,) = seen(message(0, 0, 99), *sent, *beside)
    assert (one.rule, one.severity, one.node, one.type) == ("TRF-019", "warning", 11, "")
    assert (one.text, one.cause) == (f"0 instead of {top + 1}", f"the counter always wraps after {top}")


def test_restarts_at_the_same_id_are_restarts_when_the_uptime_says_so() -> None:
    for uptime in (lambda k: k % 16 // 8, lambda _: 0, lambda k: 5 + k % 16):
        sent = [(3000 + k * 100, alive(uptime(k), 11, k % 16)) for k in range(70)]
        (one,) = seen(message(0, 0, 99), *sent)
        assert (one.rule, one.type, one.count, one.cause) == ("TRF-019", ALIVE, 4, "")


def test_restarts_from_ids_that_differ_are_restarts() -> None:
    ids = [k for top in (16, 17, 16, 16, 15) for k in range(top)]
    (one,) = seen(*(message(3000 + k * 100, one, status=k) for k, one in enumerate(ids)), message(0, 0, 99))
    assert (one.rule, one.count, one.cause) == ("TRF-019", 4, "")


def test_ids_before_0_that_are_lost_again_and_again_are_no_restarts() -> None:
    """However long it goes on."""
    sent = [message(3000 + k * 50, k % 32, status=k) for k in range(400) if k % 32 not in (12, 31)]
    (one,) = seen(message(0, 0, 99), *sent)
    assert (one.rule, one.count) == ("TRF-016", 25)
