"""What nodes say of themselves: NodeStatus, GetNodeInfo, allocation, time masters."""

from __future__ import annotations

from typing import Any

from kit.encode import Transfer, transfer
from kit.judged import Said, judge, whole
from kit.simulated import flight
from kit.traffic import ALIVE, Timed, alive, log

RULES = ("BUS-010", "BUS-020", "BUS-021", "BUS-022", "BUS-030", "BUS-031")
ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"


def arming(k: int, src: int = 11) -> Transfer:
    return transfer("uavcan.equipment.safety.ArmingStatus", {"status": 0}, src, k)


def every(span: range, make: Any) -> list[Timed]:
    return [(t, make(k)) for k, t in enumerate(span)]


def seen(*sent: Timed) -> list[Said]:
    """What the rules find of transfers at times in ms, however the capture is cut."""
    return whole(log(*sent), RULES)


def beats(*times: int) -> list[Timed]:
    return [(t, alive(100 + t // 1000, transfer_id=k)) for k, t in enumerate(times)]


def test_a_node_that_sends_without_status_is_reported() -> None:
    (one,) = seen(*every(range(10, 9000, 200), arming), *beats(0, 1000, 5000, 6000, 7000, 8000, 9000))
    assert (one.rule, one.severity, one.node, one.type) == ("BUS-020", "warning", 11, ALIVE)
    assert (one.text, one.first) == ("none for 3.8 s, node still sends", 7)


def test_a_late_status_is_a_note_and_jitter_is_nothing() -> None:
    rest = (4000, 5000)
    spoken = every(range(10, 5000, 100), arming)
    assert [one.severity for one in seen(*spoken, *beats(0, 1000, 3000, *rest))] == ["note"]
    assert seen(*spoken, *beats(0, 1000, 2400, 3200, *rest)) == []


def test_a_status_missing_to_the_end_is_reported() -> None:
    (one,) = seen(*every(range(10, 5000, 100), arming), *beats(0, 1000))
    assert (one.severity, one.text) == ("warning", "none for 3.9 s, node still sends")


def test_a_node_that_is_silent_altogether_owes_no_alive() -> None:
    others = every(range(5, 9000, 200), lambda k: alive(k // 5, src=20, transfer_id=k))
    assert seen(*every(range(10, 1100, 100), arming), *beats(0, 1000, 8000), *others) == []


def test_what_a_node_does_after_its_last_status_is_told_as_it_is() -> None:
    others = every(range(5, 20_000, 200), lambda k: alive(k // 5, src=20, transfer_id=k))
    (one,) = seen(*every(range(10, 5000, 100), arming), *beats(0, 1000), *others)
    assert (one.severity, one.text) == ("warning", "none for 3.9 s, then the node was silent")
    (never,) = seen(*every(range(10, 5000, 100), arming), *others)
    assert (never.severity, never.text) == ("note", "none for 4.9 s, then the node was silent")


def test_a_silence_of_the_node_is_no_time_in_which_it_owes_a_status() -> None:
    others = every(range(5, 20_000, 200), lambda k: alive(k // 5, src=20, transfer_id=k))
    spoken = [*range(10, 1400, 100), *range(9000, 20_000, 100)]
    sent = [(t, arming(k)) for k, t in enumerate(spoken)]
    assert seen(*sent, *beats(0, 1000, *range(9010, 20_000, 1000)), *others) == []
    (one,) = seen(*sent, *beats(0, 1000, *range(13_010, 20_000, 1000)), *others)
    assert (one.severity, one.text) == ("warning", "none for 4.0 s, node still sends")


def test_a_node_that_seldom_sends_anything_owes_its_status_all_the_same() -> None:
    others = every(range(5, 30_000, 200), lambda k: alive(k // 5, src=20, transfer_id=k))
    (one,) = seen(*every(range(10, 30_000, 5000), arming), *beats(0, 1000, 29_000), *others)
    assert (one.severity, one.text) == ("warning", "none for 24.0 s, node still sends")


def test_a_pause_of_the_whole_bus_is_left_out() -> None:
    spoken = [*range(10, 2000, 100), *range(7010, 9000, 100)]
    messages = [(t, arming(k)) for k, t in enumerate(spoken)]
    assert seen(*messages, *beats(0, 1000, 7500, 8500)) == []


def test_a_node_that_never_sent_a_status_is_one_note() -> None:
    (one,) = seen(*every(range(0, 4000, 100), arming))
    assert (one.rule, one.severity, one.count, one.first) == ("BUS-020", "note", 1, 1)
    assert seen(*every(range(0, 2900, 100), arming)) == []


def test_frames_without_a_time_are_no_silence() -> None:
    lines = log(*every(range(0, 4000, 100), arming)).splitlines(keepends=True)
    for gone in ((0,), (0, 1, 2), (39,), (0, 39), (20, 39)):
        text = "".join(line.split(" ", 1)[1] if k in gone else line for k, line in enumerate(lines))
        (one,) = whole(text, RULES)
        assert (one.rule, one.first) == ("BUS-020", 1 + (0 in gone) + 2 * (1 in gone))
        assert float(one.text.split()[2]) == round(3.9 - 0.1 * len(gone) + 0.1 * (20 in gone), 1)


def test_a_lower_uptime_is_a_restart() -> None:
    up = [(k * 1000, alive(uptime, transfer_id=k)) for k, uptime in enumerate((311, 312, 0, 1, 2, 3, 4))]
    (one,) = seen(*up)
    assert (one.rule, one.severity, one.text, one.first) == ("BUS-021", "warning", "uptime 312 s, then 0 s", 3)
    assert [one.rule for one in seen(*up[:3])] == ["BUS-021"]


def test_an_old_status_that_comes_again_is_no_restart() -> None:
    """A device that began anew after the last report is not up for longer than since then."""
    up = [(k * 1000, alive(311 + k, transfer_id=k)) for k in range(6)]
    assert "BUS-021" not in {one.rule for one in seen(*up, (2040, alive(312, transfer_id=1)))}
    assert "BUS-021" not in {one.rule for one in seen(*up[:3], (2040, alive(312, transfer_id=1)))}
    for uptime, rules in ((5, ["BUS-021"]), (6, [])):
        later = [(4000 + k * 1000, alive(uptime + k, transfer_id=k)) for k in range(4)]
        assert [one.rule for one in seen((0, alive(311)), *later)] == rules


def test_a_wrap_of_the_uptime_is_no_restart() -> None:
    top = (1 << 32) - 2
    assert seen(*((k * 1000, alive((top + k) % (1 << 32), transfer_id=k)) for k in range(5))) == []


def test_a_restart_that_was_asked_for_is_a_note() -> None:
    up = [(k * 1000, alive(uptime, transfer_id=k)) for k, uptime in enumerate((311, 312, 0, 1, 2, 3, 4))]
    ask = Transfer("request", 5, 10, bytes.fromhex("4E9EFDBEAC"), 0x569E05394A3017F0, dst=11)
    found = seen(*up, (1500, ask))
    assert [(one.rule, one.severity) for one in found] == [("BUS-021", "note")]


def test_two_uptimes_that_both_run_on_are_two_devices() -> None:
    first = [(k * 1000, alive(312 + k, transfer_id=2 * k)) for k in range(8)]
    second = [(k * 1000 + 400, alive(5 + k, transfer_id=2 * k + 1)) for k in range(8)]
    (one,) = seen(*first, *second)
    assert (one.rule, one.node, one.type, one.first) == ("BUS-010", 11, "", 2)
    assert one.text.startswith("two uptimes that both run on")


def test_two_unique_ids_are_two_devices_and_no_replaced_one() -> None:
    def info(unique: int, uptime: int) -> Transfer:
        fields = {
            "status": {"uptime_sec": uptime, "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0},
            "software_version": {
                "major": 1, "minor": 0, "optional_field_flags": 0, "vcs_commit": 0, "image_crc": 0,
            },
            "hardware_version": {
                "major": 1, "minor": 0, "unique_id": bytes([unique] * 16), "certificate_of_authenticity": b"",
            },
            "name": b"x",
        }  # fmt: skip
        return transfer("uavcan.protocol.GetNodeInfo.Response", fields, 11, 0, dst=10)

    (one,) = seen((0, info(1, 50)), (900, info(2, 7)))
    assert (one.rule, one.text) == ("BUS-010", f"two unique IDs, {'01' * 16} and {'02' * 16}")
    later = seen((0, info(1, 50)), (60_000, info(2, 7)))
    assert "BUS-010" not in {one.rule for one in later}
    assert seen((0, info(1, 50)), (900, info(1, 50))) == []


def test_health_and_mode_are_reported_by_what_they_say() -> None:
    states = ((0, 0), (0, 0), (2, 0), (2, 0), (2, 3), (2, 3))
    sick = [(k * 1000, alive(50 + k, transfer_id=k, health=h, mode=mode)) for k, (h, mode) in enumerate(states)]
    assert [(one.text, one.count, one.severity) for one in seen(*sick)] == [
        ("health error, mode operational", 2, "warning"),
        ("health error, mode software update", 2, "warning"),
    ]
    fresh = [(k * 1000, alive(8 + k, transfer_id=k, mode=1)) for k in range(5)]
    assert sorted((one.severity, one.count) for one in seen(*fresh)) == [("note", 2), ("warning", 3)]


def given(unique: int, node: int, transfer_id: int = 0) -> Transfer:
    fields = {"node_id": node, "first_part_of_unique_id": 0, "unique_id": bytes([unique] * 16)}
    return transfer(ALLOCATION, fields, 10, transfer_id)


def test_allocations_are_noted_and_conflicts_are_errors() -> None:
    found = seen((0, given(1, 12)), (100, given(2, 13, 1)), (200, given(1, 15, 2)), (300, given(3, 13, 3)))
    assert [(one.rule, one.severity) for one in found] == [
        ("BUS-030", "note"), ("BUS-030", "note"), ("BUS-030", "error"), ("BUS-030", "error"),
    ]  # fmt: skip
    assert found[2].text.endswith("has node 15, but had node 12 before")
    assert found[3].text.endswith(f"as has {'02' * 16}")


def test_a_node_that_asks_in_vain_is_noted() -> None:
    fields = {"node_id": 0, "first_part_of_unique_id": 1, "unique_id": bytes([1] * 6)}
    ask = transfer(ALLOCATION, fields, 0, 0, kind="anonymous")
    assert [one.text for one in seen((0, ask))] == ["010101010101.. has node none, asked in vain"]
    assert [one.text for one in seen((0, ask), (10, given(1, 12)))] == [f"{'01' * 16} has node 12, given"]


def test_two_time_masters_are_named_together() -> None:
    def time(src: int, k: int) -> Transfer:
        return Transfer("message", 4, src, bytes(7), 0x20271116A793C2DB, k)

    both = [*every(range(0, 2900, 1000), lambda k: time(40, k)), *every(range(100, 2900, 1000), lambda k: time(1, k))]
    (one,) = seen(*both)
    assert (one.rule, one.node, one.text, one.first, one.count) == ("BUS-031", 40, "nodes 1 and 40", 2, 5)
    assert seen((0, time(40, 0)), (2001, time(1, 0))) == []


def test_a_steady_flight_breaks_nothing() -> None:
    assert [one for one in judge(flight(seconds=10), RULES) if one.severity != "note"] == []
