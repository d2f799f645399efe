"""Transfer IDs: gaps, copies, restarts, shared counters, two senders, and interfaces that differ."""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING

import pytest
from kit.encode import Transfer, transfer
from kit.judged import Said, outcome, proved, whole
from kit.simulated import flight
from kit.traffic import ALIVE, Timed, alive, log

from analyzer.rules.counters.id_steps import WITHOUT_START

if TYPE_CHECKING:
    from collections.abc import Sequence

IDS = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")
ARMING = "uavcan.equipment.safety.ArmingStatus"


def message(t: int, transfer_id: int, src: int = 11, status: int = 0, name: str = ALIVE) -> Timed:
    """One NodeStatus (or ArmingStatus) `t` ms into the capture."""
    if name == ALIVE:
        return t, alive(5, src, transfer_id, vendor_specific_status_code=status)
    return t, transfer(name, {"status": status & 1}, src, transfer_id)


OTHERS = [message(250 + 500 * k, k % 32, 98, k) for k in range(20)]


def seen(*sent: Timed) -> list[Said]:
    return whole(log(*sent), IDS)


def count(*ids: int, since: int = 3000, apart: int = 100) -> list[Timed]:
    """Messages with these IDs, each with a payload of its own, behind one that opens the capture."""
    return [message(0, ids[0] - 1, 99), *(message(since + k * apart, one, status=k) for k, one in enumerate(ids))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 7])
@pytest.mark.parametrize("rule", ["TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "TRF-028"])
def test_a_simulated_fault_is_found_where_the_witness_finds_it(rule: str, seed: int) -> None:
    assert proved(rule, flight(f"{rule}@5", seconds=10, seed=seed), step=7)


def test_a_gap_names_what_is_missing() -> None:
    (one,) = seen(*count(5, 6, 10, 11))
    assert (one.rule, one.severity, one.node, one.type, one.frames) == ("TRF-016", "warning", 11, ALIVE, (4,))
    assert one.text == "expected 7, got 10: 3 missing"


def test_ids_wrap_without_a_gap() -> None:
    assert seen(*count(30, 31, 0, 1)) == []


def test_a_gap_soon_after_the_start_or_after_a_silence_is_a_note() -> None:
    assert [one.severity for one in seen(*count(5, 7, since=100))] == ["note"]
    assert [one.severity for one in seen(*OTHERS, *count(5, 7, apart=2001))] == ["note"]
    assert [one.severity for one in seen(*OTHERS, *count(5, 7, apart=2000))] == ["warning"]


def test_behind_a_gap_in_the_capture_ids_begin_anew() -> None:
    """What was sent meanwhile is not known; without the pause each of these would be a breach."""
    for after, rule in ((5, "TRF-018"), (0, "TRF-016"), (9, "TRF-016")):
        assert seen(*count(4, 5), *count(after, (after + 1) % 32, since=4101)[1:]) == []
        (one,) = seen(*count(4, 5), *count(after, (after + 1) % 32, since=4100)[1:])
        assert one.rule == rule


def test_a_gap_beside_lost_frames_is_a_note() -> None:
    lines = log(*count(5, 6, 10, 11)).splitlines(keepends=True)
    lines.insert(4, "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n")
    assert [one.severity for one in whole("".join(lines), IDS)] == ["note"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("ids", [(5, 6, 0, 1), (5, 6, 6, 7), (5, 6, 10, 11)])
def test_frames_that_the_recorder_lost_since_the_transfer_before_explain_any_step(ids: tuple[int, ...]) -> None:
    sent = [*OTHERS, *count(*ids, apart=1900)]
    (bare,) = seen(*sent)
    lines = log(*sent).splitlines(keepends=True)
    lost = sum(t <= 4900 for t, _ in sent)
    lines.insert(lost, "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n")
    (noted,) = whole("".join(lines), IDS)
    assert (bare.rule, noted.severity) == (noted.rule, "note")
    assert bare.severity != "note"


def test_the_last_ids_before_0_were_lost_unless_the_whole_node_began_anew() -> None:
    (lost,) = seen(*count(28, 29, 0, 1))
    assert (lost.rule, lost.text) == ("TRF-016", "expected 30, got 0: 2 missing")
    (lost,) = seen(*count(20, 21, 0, 1))
    assert (lost.rule, lost.text) == ("TRF-016", "expected 22, got 0: 10 missing")
    beside = [message(3050 + k * 100, one, name=ARMING, status=k % 2) for k, one in enumerate((7, 8, 0, 1))]
    assert {one.rule for one in seen(*count(28, 29, 0, 1), *beside)} == {"TRF-019"}


def test_a_backward_jump_is_a_gap() -> None:
    (gap,) = seen(*count(20, 21, 3, 4))
    assert (gap.rule, gap.text) == ("TRF-016", "expected 22, got 3: 13 missing")


def up(*since: int, ids: Sequence[int]) -> list[Timed]:
    """NodeStatus twice a second, with these uptimes in halves of a second and transfer IDs."""
    return [(3000 + 500 * k, alive(half // 2, 11, one)) for k, (half, one) in enumerate(zip(since, ids, strict=True))]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("lost", [3, 10, 24])
def test_a_restart_has_a_second_witness(lost: int) -> None:
    ids = [*range(31 - lost - 20, 32 - lost), *range(20)]
    beside = [message(3020 + k * 100, one % 32, name=ARMING, status=k) for k, one in enumerate(ids)]
    fell = [*range(600, 605), *range(4)]
    for uptimes, numbers, rule in (
        (range(600, 609), range(7, 16), "TRF-016"),  # it runs on
        (fell, [*range(7, 12), *range(4)], "TRF-019"),
        (fell, range(7, 16), "TRF-019"),
        (range(600, 609), [*range(7, 12), *range(4)], "TRF-019"),  # all types of the node
    ):
        found = seen(*OTHERS, *up(*uptimes, ids=numbers), *beside)
        assert {(one.rule, one.type) for one in found if one.type == ARMING} == {(rule, ARMING)}


def test_two_types_that_come_to_zero_by_losses_have_not_restarted() -> None:
    """The uptime runs on, in a type that counts on."""
    beside = [
        (3000 + late + k * 100, transfer(name, {"status": 0}, 11, one)) if name == ARMING else
        (3000 + late + k * 100, Transfer("message", 1001, 11, bytes(6), 0, one))
        for late, name in ((20, ARMING), (40, "compass"))
        for k, one in enumerate([*range(10, 22), *range(10)])
    ]  # fmt: skip
    found = seen(*OTHERS, *up(*range(600, 605), ids=range(7, 12)), *beside)
    assert {one.rule for one in found} == {"TRF-016"}


def test_an_uptime_from_before_the_capture_witnesses_a_restart_and_one_that_is_too_long_does_not() -> None:
    ids = [*range(10, 22), *range(20)]
    beside = [message(3020 + k * 100, one, name=ARMING, status=k) for k, one in enumerate(ids)]
    for seconds, rule in ((0, "TRF-019"), (900, "TRF-016")):
        found = seen(*OTHERS, *beside, (4500, alive(seconds, 11, 3)), (5500, alive(seconds + 1, 11, 4)))
        assert {one.rule for one in found} == {rule}


def test_an_id_that_was_0_when_its_node_restarted_did_not_stand_still() -> None:
    beside = [message(3050 + k * 100, one, name=ARMING, status=k) for k, one in enumerate((31, 0))]
    again = message(3250, 0, name=ARMING, status=0)
    restarted = seen(*count(20, 21, 22, 0, 1), *beside, again)
    assert sorted((one.rule, one.type, one.count) for one in restarted) == [
        ("TRF-019", ARMING, 1),
        ("TRF-019", ALIVE, 1),
    ]
    alone = seen(*count(20, 21, 22, 23, 24), *beside, again)
    assert [(one.rule, one.type) for one in alone] == [("TRF-018", ARMING)]
    stuck = seen(*count(20, 21, 22, 0, 1), *beside, again, message(3450, 0, name=ARMING, status=1))
    assert sorted((one.rule, one.type) for one in stuck) == [
        ("TRF-018", ARMING), ("TRF-019", ARMING), ("TRF-019", ALIVE),
    ]  # fmt: skip


def test_an_id_that_has_come_around_again_means_31_lost() -> None:
    (one,) = seen(*OTHERS, *count(4, 5, apart=50), message(3050 + 32 * 50, 5, status=7))
    assert (one.rule, one.text) == ("TRF-016", "expected 6, got 5: 31 missing")
    (one,) = seen(*OTHERS, *count(4, 5, apart=50), message(3050 + 50, 5, status=7))
    assert one.rule == "TRF-018"


def test_what_two_devices_with_one_id_bring_about_is_a_note_that_says_so() -> None:
    rules = (*IDS, "BUS-021")
    both = [
        (3000 + k * 500, alive(900 + 3 * k if k % 2 else k % 4, 11, (20 * (k % 2) + k // 2) % 32)) for k in range(40)
    ]  # fmt: skip
    found = {one.rule: one for one in whole(log(*both), rules)}
    assert (found["BUS-010"].severity, found["BUS-021"].severity) == ("error", "note")
    assert found["BUS-021"].cause == "Two devices share a node ID (BUS-010)"
    alone = [(3000 + k * 3000, alive(4 - k % 2, 11, k % 32)) for k in range(9)]
    assert {(one.rule, one.severity, one.cause) for one in whole(log(*alone), rules)} == {("BUS-021", "warning", "")}


def test_a_repeated_id_is_a_copy_or_stands_still() -> None:
    messages = count(5, 6)
    (copy,) = seen(*messages, message(3102, 6, status=1))
    assert (copy.rule, copy.text) == ("TRF-017", "transfer ID 6 again after 2.0 ms, same payload")
    (still,) = seen(*messages, message(3102, 6, status=9))
    assert (still.rule, still.severity) == ("TRF-018", "error")


def test_responses_carry_the_id_of_their_request() -> None:
    fields = {"index": 0, "value": {"empty": {}}, "name": b"a"}
    asks = [transfer("uavcan.protocol.param.GetSet.Request", fields, 10, k * 5, dst=11) for k in range(3)]
    text = log(*((k * 10, one) for k, one in enumerate(asks)))
    assert {one.rule for one in whole(text, IDS)} == {"TRF-016"}
    swapped = text.replace("0B8B8A", "0B0A8B")
    assert swapped != text
    assert whole(swapped, IDS) == []


def two(first: range, second: range, apart: int = 100) -> list[Timed]:
    """Two senders behind node 11, by turns."""
    ours = [message(3000 + k * apart, one % 32, status=k) for k, one in enumerate(first)]
    return [*ours, *(message(3000 + k * apart + 40, one % 32, status=99 + k) for k, one in enumerate(second))]


@pytest.mark.parametrize("begin", [3, 20, 31])
def test_two_senders_are_one_finding(begin: int) -> None:
    (one,) = seen(message(0, 0, 99), *two(range(3, 15), range(begin, begin + 12)))
    assert (one.rule, one.severity, one.node, one.type, one.first) == ("BUS-010", "error", 11, "", 3)
    assert one.text.startswith(f"two transfer-ID counters in {ALIVE}")


def test_too_few_transfers_of_the_second_are_gaps() -> None:
    found = seen(message(0, 0, 99), *two(range(3, 15), range(20, 24)))
    assert {one.rule for one in found} == {"TRF-016"}
    assert sum(one.count for one in found) == 8


@pytest.mark.slow
def test_two_senders_of_unequal_rates_are_told_apart() -> None:
    ours = [message(3000 + k * 50, k % 32, status=k) for k in range(120)]
    rare = [message(3020 + k * 500, (k + 9) % 32, status=999 + k) for k in range(12)]
    assert {one.rule for one in seen(message(0, 0, 99), *ours, *rare)} == {"BUS-010"}


def test_every_message_sent_twice_is_no_second_sender() -> None:
    twice = [message(3000 + k * 50 + d, k, status=k) for k in range(20) for d in (0, 5)]
    (one,) = seen(message(0, 0, 99), *twice)
    assert (one.rule, one.count) == ("TRF-017", 20)


@pytest.mark.slow
def test_two_simulated_devices_are_one_finding_instead_of_all_that_they_cause() -> None:
    found = whole(flight(scenario="duplicate-node"), IDS, (7,))
    assert [(one.rule, one.node) for one in found] == [("BUS-010", 13)]


def test_a_shared_counter_replaces_gaps() -> None:
    sent = [message(3000 + k * 50, k % 32, status=k, name=ARMING if k % 4 == 3 else ALIVE) for k in range(60)]
    (one,) = seen(message(0, 0, 99), *sent)
    assert (one.rule, one.severity, one.text) == ("TRF-020", "note", "2 types of node 11 count together")


def test_two_types_that_both_lose_transfers_share_no_counter() -> None:
    kept = [k for k in range(60) if k % 6]
    sent = [message(3000 + k * 50, k % 32, status=k) for k in kept]
    sent += [message(3010 + k * 50, k % 32, status=k, name=ARMING) for k in kept]
    assert {one.rule for one in seen(message(0, 0, 99), *sent)} == {"TRF-016"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("ids", "apart"),
    [
        *product(((5, 7, 6, 8), (31, 1, 0, 2), (30, 0, 31, 1), (29, 31, 30, 0), (5, 7, 8, 6, 9)), (1, 100, 900)),
        ((5, 8, 6, 7, 9), 900), ((5, *range(8, 14), 6, 7, 14), 300),
    ],
)  # fmt: skip
def test_transfers_in_another_order_are_one_finding_and_nothing_is_missing(ids: tuple[int, ...], apart: int) -> None:
    ahead = [(ids[0] - k) % 32 for k in (2, 1)]
    behind = [(ids[-1] + k) % 32 for k in (1, 2)]
    (one,) = seen(*OTHERS, *count(*ahead, *ids, *behind, apart=apart))
    assert (one.rule, one.severity, one.count, one.cause) == ("TRF-016", "warning", 1, "transfers in another order")
    assert one.text == f"expected {(ids[0] + 1) % 32}, got {ids[1]}: 0 missing"


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "ids",
    [
        (5, 7, 6, 9), (5, 7, 6, 7), (5, 8, 6, 8), (5, 7, 5, 8), (5, 17, 6, 18), (5, 7, 6), (5, 20, 3, 21),
        (5, 7, 6, 7, 8, 9, 10, 8), (5, *range(8, 15), 6, 7, 15),
    ],
)  # fmt: skip
def test_what_does_not_go_on_as_if_nothing_had_been_is_no_other_order(ids: tuple[int, ...]) -> None:
    found = seen(*OTHERS, *count(4, *ids, ids[-1] + 1))
    assert {one.cause for one in found} == {""}
    assert sum(one.count for one in found) == sum(after != before + 1 for before, after in pairwise(ids))


def test_an_order_is_that_of_one_session_and_its_frames_are_evidence() -> None:
    beside = [message(3050 + k * 100, one, name=ARMING, status=k % 2) for k, one in enumerate((7, 9, 10, 12))]
    text = log(*OTHERS, *count(5, 7, 6, 8), *beside)
    found = whole(text, IDS)
    assert [(one.type, one.count, one.cause) for one in found] == [
        (ALIVE, 1, "transfers in another order"), (ARMING, 2, ""),
    ]  # fmt: skip
    ((_, run), _) = outcome(text, IDS).runs
    assert [line.split("#")[1][-2:] for line in run.examples[0].lines] == ["C7", "C6"]


@pytest.mark.slow
def test_an_order_that_changes_again_and_again_is_not_two_senders() -> None:
    ids = [k // 4 * 4 + (0, 2, 1, 3)[k % 4] for k in range(320)]
    (one,) = seen(*OTHERS, *count(*(k % 32 for k in ids)))
    assert (one.rule, one.count, one.cause) == ("TRF-016", 80, "transfers in another order")


def test_a_transfer_in_another_order_soon_after_the_start_is_a_note() -> None:
    assert [one.severity for one in seen(*count(5, 7, 6, 8, since=100))] == ["note"]


@pytest.mark.sampled(8)
@pytest.mark.parametrize(
    ("cut", "gone", "causes"),
    [
        ((4,), (), {("expected 4, got 5: 1 missing", WITHOUT_START)}),
        ((), (4,), {("expected 4, got 5: 1 missing", "")}),
        ((4, 5), (), {("expected 4, got 6: 2 missing", WITHOUT_START)}),
        ((4,), (5,), {("expected 4, got 6: 2 missing", "")}),
        ((4,), (9,), {("expected 4, got 5: 1 missing", WITHOUT_START), ("expected 9, got 10: 1 missing", "")}),
        ((4,), (4 + 32,), {("expected 4, got 5: 1 missing", WITHOUT_START), ("expected 4, got 5: 1 missing", "")}),
        ((31,), (), {("expected 31, got 0: 1 missing", WITHOUT_START)}),
    ],
)  # fmt: skip
def test_a_transfer_that_only_lacks_its_start_is_told_from_a_missing_one(
    cut: tuple[int, ...], gone: tuple[int, ...], causes: set[tuple[str, str]]
) -> None:
    """A copy of it from another node, or one of another type, says nothing."""
    text = log(*OTHERS)
    for k in range(44):
        fields = {"data_sequence": k, "data": [1, 2, 3, k]}
        for src in (11, 12):
            lines = log((3000 + k * 100 + src, transfer("PUSHCAN", fields, src, k % 32))).splitlines(keepends=True)
            text += "".join(lines[k in cut and src == 11 :] if k not in gone or src == 12 else ())
        text += "".join(log((3050 + k * 100, alive(k, 12, (k + (k > 3)) % 32))))
    found = whole(text, ("TRF-016",))
    assert {(one.text, one.cause) for one in found if one.node == 11} == causes
    assert [(one.type, one.cause) for one in found if one.node == 12] == [(ALIVE, "")]


@pytest.mark.slow
def test_frames_without_a_start_count_only_between_the_transfers_of_their_own_session() -> None:
    def sent(t: int, number: int, src: int = 11, dst: int = 12) -> list[str]:
        fields = {"index": 0, "value": {"empty": {}}, "name": b"a much longer name"}
        one = transfer("uavcan.protocol.param.GetSet.Request", fields, src, number, dst=dst)
        return log((3000 + t, one)).splitlines(keepends=True)

    def causes(astray: list[str], later: Sequence[str] = ()) -> list[str]:
        whole_ones = [line for k in range(4) for line in sent(k * 100, k)]
        text = log(*OTHERS) + "".join((*whole_ones, *astray, *sent(500, 5), *later))
        return [one.cause for one in whole(text, ("TRF-016",)) if one.node == 11 and one.text.endswith("1 missing")]

    assert causes(sent(400, 4)[1:]) == [WITHOUT_START]
    for other in (sent(400, 4, dst=13), sent(400, 4, src=12, dst=11), sent(400, 7)):
        assert causes(other[1:]) == [""]
    assert causes([], sent(600, 4)[1:]) == [""]
