"""Transfer IDs: gaps, copies, restarts, shared counters, two senders, and interfaces that differ."""

from __future__ import annotations

import pytest
from encode import transfer
from faulted import flight
from judged import Said, judge, whole
from proved import proved
from sent import ALIVE, Sent, alive, log

IDS = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")
ARMING = "uavcan.equipment.safety.ArmingStatus"


def message(t: int, transfer_id: int, src: int = 11, status: int = 0, name: str = ALIVE) -> Sent:
    """One NodeStatus (or ArmingStatus) `t` ms into the capture."""
    if name == ALIVE:
        return t, alive(5, src, transfer_id, vendor_specific_status_code=status)
    return t, transfer(name, {"status": status & 1}, src, transfer_id)


def seen(*sent: Sent) -> list[Said]:
    return whole(log(*sent), IDS)


def count(*ids: int, since: int = 3000, apart: int = 100) -> list[Sent]:
    """Messages with these IDs, each with a payload of its own, behind one that opens the capture."""
    return [message(0, ids[0] - 1, 99), *(message(since + k * apart, one, status=k) for k, one in enumerate(ids))]


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
    assert [one.severity for one in seen(*count(5, 7, apart=2001))] == ["note"]
    assert [one.severity for one in seen(*count(5, 7, apart=2000))] == ["warning"]


def test_a_gap_beside_lost_frames_is_a_note() -> None:
    lines = log(*count(5, 6, 10, 11)).splitlines(keepends=True)
    lines.insert(4, "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n")
    assert [one.severity for one in whole("".join(lines), IDS)] == ["note"]


def test_a_backward_jump_is_a_gap_and_one_to_zero_a_restart() -> None:
    (gap,) = seen(*count(20, 21, 3, 4))
    assert (gap.rule, gap.text) == ("TRF-016", "expected 22, got 3: 13 missing")
    (restart,) = seen(*count(20, 21, 0, 1))
    assert (restart.rule, restart.text) == ("TRF-019", "0 instead of 22")


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


def two(first: range, second: range, apart: int = 100) -> list[Sent]:
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


def test_two_senders_of_unequal_rates_are_told_apart() -> None:
    ours = [message(3000 + k * 50, k % 32, status=k) for k in range(120)]
    rare = [message(3020 + k * 500, (k + 9) % 32, status=999 + k) for k in range(12)]
    assert {one.rule for one in seen(message(0, 0, 99), *ours, *rare)} == {"BUS-010"}


def test_every_message_sent_twice_is_no_second_sender() -> None:
    twice = [message(3000 + k * 50 + d, k, status=k) for k in range(20) for d in (0, 5)]
    (one,) = seen(message(0, 0, 99), *twice)
    assert (one.rule, one.count) == ("TRF-017", 20)


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


def test_a_steady_flight_breaks_nothing() -> None:
    assert judge(flight(seconds=10), (*IDS, "TRF-028")) == []
