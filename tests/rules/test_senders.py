"""One node ID whose transfer IDs come from several counters, from one that skips, or from one that wraps early."""

from __future__ import annotations

import re
from random import Random
from typing import TYPE_CHECKING, NamedTuple

import pytest
from kit.encode import log_line, transfer
from kit.judged import Said, whole
from kit.traffic import ALIVE, MS, START, Timed, alive, log
from kit.traffic import STATUS as REPORT

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from kit.encode import Frame

IDS = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")
ARMING = "uavcan.equipment.safety.ArmingStatus"


def message(t: int, transfer_id: int, src: int = 11, status: int = 0, name: str = ALIVE) -> Timed:
    """One NodeStatus (or ArmingStatus) `t` ms into the capture."""
    if name == ALIVE:
        return t, alive(5, src, transfer_id, vendor_specific_status_code=status)
    return t, transfer(name, {"status": status & 1}, src, transfer_id)


def seen(*sent: Timed) -> list[Said]:
    return whole(log(*sent), IDS)


def several(offsets: Sequence[int], each: int = 24, *, lost: Sequence[int] = ()) -> list[Timed]:
    """As many senders behind node 11 as there are offsets, by turns; the transfers with these numbers are missing."""
    sent = [
        message(3000 + k * 100 + n * (90 // len(offsets)) + k * n % 3, (offset + k) % 32, status=k * 16 + n)
        for k in range(each) for n, offset in enumerate(offsets)
    ]  # fmt: skip
    return [message(0, 0, 99), *(one for k, one in enumerate(sent) if k not in lost)]


@pytest.mark.sampled(7)
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


@pytest.mark.slow
@pytest.mark.parametrize(("every", "kept"), [(31, 30), (20, 16), (18, 4), (12, 8), (9, 4), (5, 3)])
def test_losses_at_regular_intervals_are_no_second_sender(every: int, kept: int) -> None:
    """By their IDs alone they would be: what is lost now comes after a round of 32."""
    sent = [message(3000 + k * 20, k % 32, status=k) for k in range(640) if k % every < kept]
    assert {one.rule for one in seen(message(0, 0, 99), *sent)} <= {"TRF-016", "TRF-019"}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("step", [2, 3, 5, 8, 30, 31])
def test_a_sender_that_skips_ids_is_no_second_one_and_does_not_restart(step: int) -> None:
    sent = [message(3000 + k * 50, k * step % 32, status=k) for k in range(80)]
    beside = [message(3020 + k * 50, (k * step + 7) % 32, name=ARMING, status=k // 7) for k in range(80)]
    assert {one.rule for one in seen(message(0, 0, 99), *sent, *beside)} == {"TRF-016"}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("top", [7, 15, 29, 30])
def test_a_counter_that_wraps_early_each_time_is_one_finding(top: int) -> None:
    """Of whatever types, and no restart: the uptime goes on."""
    wraps = top + 1
    sent = [(3000 + k * 40, alive(5 + k * 40 // 1000, 11, k % wraps)) for k in range(3 * wraps + 4)]
    beside = [message(3020 + k * 40, (k + 3) % wraps, name=ARMING, status=k // 7) for k in range(3 * wraps + 4)]
    (one,) = seen(message(0, 0, 99), *sent, *beside)
    assert (one.rule, one.severity, one.node, one.type) == ("TRF-019", "warning", 11, "")
    assert (one.text, one.cause) == (f"0 instead of {top + 1}", f"the counter always wraps after {top}")


@pytest.mark.slow
def test_restarts_at_the_same_id_are_restarts_when_the_uptime_says_so() -> None:
    for uptime in (lambda k: k % 16 // 8, lambda _: 0, lambda k: 5 + k % 16):
        sent = [(3000 + k * 100, alive(uptime(k), 11, k % 16)) for k in range(70)]
        (one,) = seen(message(0, 0, 99), *sent)
        assert (one.rule, one.type, one.count, one.cause) == ("TRF-019", ALIVE, 4, "")


def test_restarts_from_ids_that_differ_are_restarts() -> None:
    ids = [k for top in (16, 17, 16, 16, 15) for k in range(top)]
    (one,) = seen(*((3000 + k * 100, alive(one // 8, 11, one)) for k, one in enumerate(ids)), message(0, 0, 99))
    assert (one.rule, one.count, one.cause) == ("TRF-019", 4, "")


@pytest.mark.slow
def test_ids_before_0_that_are_lost_again_and_again_are_no_restarts() -> None:
    """However long it goes on."""
    sent = [message(3000 + k * 50, k % 32, status=k) for k in range(400) if k % 32 not in (12, 31)]
    (one,) = seen(message(0, 0, 99), *sent)
    assert (one.rule, one.count) == ("TRF-016", 25)


COMMAND, STATUS = "RawCommand", "ESCStatus"
CAUSED = ("TRF-003", "TRF-005", "TRF-006", "TRF-010", "TRF-015", "TRF-026", "CAN-014")
FLOOD = 2000, 4000  # ms


class Sender(NamedTuple):
    """One of several behind a node ID: `apart` ms between its transfers, of which only the start comes if it floods."""

    name: str = COMMAND
    apart: float = 4.5
    since: float = 0
    until: float = 6000
    first_id: int = 0
    priority: int = 5
    channels: int = 8
    floods: bool = False
    lost: Collection[int] = ()
    later: float = 0.15  # ms to the next frame

    def frames(self) -> Iterator[Frame]:
        """All its frames; transfers of the numbers `lost` do not come."""
        for k in range(round((self.until - self.since) / self.apart)):
            t = START + round((self.since + k * self.apart + k * 7 % 5 * self.apart / 9) * MS)
            fields = (
                {"cmd": [k % 8192] * self.channels} if self.name == COMMAND else REPORT | {"rpm": k, "esc_index": 2}
            )
            one = transfer(self.name, fields, 1, (self.first_id + k) % 32, priority=self.priority)
            if k not in self.lost:
                yield from one.frames(t, round(self.later * MS))[: 1 if self.floods else None]


def by_time(*senders: Sender) -> str:
    frames = sorted((one for sender in senders for one in sender.frames()), key=lambda one: one.t)
    return "".join(log_line(one) + "\n" for one in frames)


@pytest.mark.sampled(20)
@pytest.mark.parametrize("later", [0.15, 0.5])
@pytest.mark.parametrize(
    "flood",
    [
        Sender(apart=1.1), Sender(apart=3), Sender(apart=20), Sender(apart=0.4), Sender(apart=1.3, priority=0),
        Sender(apart=1.3, priority=31), Sender(apart=1.7, channels=4), Sender(apart=1.7, channels=14),
        Sender(apart=4.5, first_id=9), Sender(name=STATUS, apart=2.3),
    ],
)  # fmt: skip
def test_a_flood_of_starts_is_a_second_sender_from_its_first_second_on(flood: Sender, later: float) -> None:
    """What it does to the transfers of the other one is no loss and no restart."""
    since, until = FLOOD
    text = by_time(Sender(flood.name, later=later, first_id=3), flood._replace(since=since, until=until, floods=True))
    found = whole(text, (*IDS, *CAUSED), (211,))
    (one,) = [one for one in found if one.rule in IDS]
    assert (one.rule, one.severity, one.node, one.type) == ("BUS-010", "error", 1, "")
    assert one.text.startswith(f"two transfer-ID counters in {flood.name}, at ")
    assert 0 <= _milliseconds(text, one.first) - since < 500
    assert until - 1500 < _milliseconds(text, one.last) < until + 500
    assert {one.severity for one in found if one.rule in CAUSED} == {"note"}


def _milliseconds(text: str, frame: int) -> float:
    return float(text.splitlines()[frame - 1][5:18]) * 1000


@pytest.mark.slow
@pytest.mark.parametrize("apart", [3, 4.5, 11])
@pytest.mark.parametrize("channels", [4, 8])
@pytest.mark.parametrize("priority", [5, 31])
def test_two_senders_that_finish_their_transfers_are_one_finding(apart: float, channels: int, priority: int) -> None:
    other = Sender(apart=apart, since=2000, until=4000, channels=channels, priority=priority, first_id=11)
    (one,) = [one for one in whole(by_time(Sender(), other), IDS, (211,)) if one.rule in IDS]
    assert one.text.startswith("two transfer-ID counters in RawCommand, at ")


def test_counters_that_losses_left_behind_are_not_counted() -> None:
    flood = Sender(apart=2, since=1000, until=2000, floods=True, first_id=20)
    before, one = whole(by_time(Sender(until=2500, lost=range(215, 440, 25)), flood), IDS, (211,))
    assert (before.rule, before.count) == ("TRF-016", 1)
    assert one.text.startswith("two transfer-ID counters in RawCommand, at ")


def test_what_was_lost_before_a_flood_and_long_after_it_is_lost() -> None:
    real = Sender(apart=25, until=40_000, lost={100, *range(480, 1600, 40)})
    text = by_time(real, Sender(apart=5, since=7000, until=11_000, floods=True))
    found = [(one.rule, one.count, round(_milliseconds(text, one.first), -3)) for one in whole(text, IDS, (211,))]
    assert [found[0], found[2]] == [("TRF-016", 1, 3000), ("TRF-016", 27, 13_000)]
    assert [found[1][0], *(rule for rule, *_ in found[3:])] == ["BUS-010"]


def others(ids: Callable[[int], int], apart: float, *, floods: bool) -> list[Frame]:
    """Transfers of a second sender from 2 s to 4 s, with IDs of its own."""
    frames: list[Frame] = []
    for k in range(round(2000 / apart)):
        one = transfer(COMMAND, {"cmd": [900 + k] * 8}, 1, ids(k), priority=5)
        t = START + round((2000 + k * apart + k * 5 % 7 * apart / 11) * MS)
        frames += one.frames(t, 150_000)[: 1 if floods else None]
    return frames


@pytest.mark.sampled(4)
@pytest.mark.parametrize("floods", [False, True])
@pytest.mark.parametrize("apart", [1.3, 7, 40])
@pytest.mark.parametrize("said", ["always 20", "no order"])
def test_a_counter_that_goes_on_beside_ids_that_do_not_count_is_one_of_two_senders(
    said: str, apart: float, floods: bool
) -> None:
    order = Random(3)
    other = others(lambda _: 20 if said[0] == "a" else order.randrange(32), apart, floods=floods)
    frames = sorted((*Sender().frames(), *other), key=lambda one: one.t)
    text = "".join(log_line(one) + "\n" for one in frames)
    (one,) = [one for one in whole(text, IDS, (211,)) if one.rule in IDS]
    assert (one.rule, one.node) == ("BUS-010", 1)
    assert re.fullmatch(rf"a transfer-ID counter in RawCommand at \d+, and in between {said}", one.text)
    assert 1990 < _milliseconds(text, one.first) < 2500


@pytest.mark.sampled(4)
@pytest.mark.parametrize("k", range(1, 4))
def test_late_copies_are_no_second_sender(k: int) -> None:
    sent = [message(3000 + n * 50, n % 32, status=n) for n in range(100)]
    copies = [(t + 50 * k + 7, one) for t, one in sent[::4]]
    assert {one.rule for one in seen(message(0, 0, 99), *sent, *copies)} <= {"TRF-016", "TRF-017"}


def test_a_sender_that_begins_its_transfers_again_is_one() -> None:
    """Every second one is given up behind its first frame."""
    real = Sender(apart=9, until=4000)
    text = by_time(real, real._replace(since=-2, channels=9, floods=True))
    assert whole(text, IDS, (211,)) == []


@pytest.mark.parametrize("every", [2, 3, 5])
def test_a_sender_whose_later_frames_get_lost_is_one(every: int) -> None:
    text = by_time(Sender(until=3000)).splitlines(keepends=True)
    starts = [k for k, line in enumerate(text) if int(line.split("#")[1][-3:-1], 16) & 0x80]
    lost = {k + d for k in starts[40::every] for d in (1, 2)}
    assert whole("".join(line for k, line in enumerate(text) if k not in lost), IDS, (211,)) == []
