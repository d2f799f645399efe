"""Settings of faults of packets; that each fault is in the bytes is for the witness to prove."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import Flight, clean, fly

if TYPE_CHECKING:
    from witness.reader import Transfer

SECONDS, SEED = 4, 5
GROUND = 125
# Where 16-bit numbers begin, by frame ID; bytes from 0.
WORDS = {
    0x15: (7, 9, 12, 14, 16, 18, 20, 23, 25),
    0x1E: (38, 40, 42, 44, 46, 48, 51),
}
# What breaks no rule: a value that the field may have, has no room for or has already, or another field.
HARMLESS = """
PUSH-001 header=0x7B8C header=0xEC96 header=0x1EC96; PUSH-003 by=0 by=256; PUSH-004 by=0; PUSH-005 by=256;
PUSH-007 value=0x1E value=0x12B; PUSH-008 value=0xA9 value=0x100; PUSH-009 by=-256;
PUSH-101 value=0 value=255 value=258 field=throttle_priority:value=1 field=throttle_priority:value=0xFFFF field=colour
 field=position_loop:value=255 field=position_loop:value=256 field=bus_rate:value=5 field=report_rate:value=400
 field=led:value=9; PUSH-103 by=0 by=65536; PUSH-301 value=0xBB value=0x177;
PUSH-302 value=10000 value=77536 mode=0x66 mode=0x77; PUSH-303 value=0 value=65537; PUSH-401 value=0xCC value=0x142;
PUSH-402 value=36000 value=102036; PUSH-403 value=0 value=10400 value=19500; PUSH-404 value=250 value=508;
PUSH-405 by=0 by=65536; PUSH-406 value=0 value=257; PUSH-407 by=0 by=-60 field=voltage;
PUSH-408 value=32766 value=32768 field=voltage field=colour; PUSH-409 percent=0 percent=2 field=speed:percent=-4
 field=current:percent=9 field=position; PUSH-501 value=65 value=0 value=0x1B5 field=led;
PUSH-502 value=1 field=bus_rate:value=0 field=report_rate:value=400 field=position_loop:value=1 field=led:value=7
"""


def word(packet: bytes, number: int) -> int:
    """The 16-bit number that begins at a byte, counted from 1."""
    return int.from_bytes(packet[number - 1 : number + 1], "little")


@cache
def flight(*orders: str) -> Flight:
    return fly(*orders, seconds=SECONDS, seed=SEED)


def usual() -> Flight:
    return clean(SECONDS, seed=SEED)


def answer(seen: Flight, rule: str) -> dict[str, Any]:
    (found,) = seen.answers(rule)
    assert seen.unused == ()
    return found


def shown(seen: Flight, rule: str) -> list[Transfer]:
    """The transfers that the answer lists; it lists all frames of each, and their CRC is right."""
    numbers = set(answer(seen, rule)["frames"])
    found = [one for one in seen.log.transfers if one.numbers & numbers]
    assert {number for one in found for number in one.numbers} == numbers
    assert {one.status for one in found} == {"ok"}
    return found


def packets(seen: Flight, name: str, node: int) -> list[tuple[int, bytes]]:
    """(ns since 1970, packet) of every transfer of a node."""
    return [(one.t, one.payload[4:]) for one in seen.log.of(name) if one.first.src == node]


def sessions(seen: Flight, *but: tuple[str, int]) -> dict[int, list[bytes]]:
    """The frames of each identifier in order, without those of some types and nodes."""
    found = defaultdict(list)
    for frame in seen.log.frames:
        if (frame.name, frame.src) not in but:
            found[frame.id].append(frame.data)
    return found


def lone(seen: Flight, rule: str) -> tuple[bytes, bytes]:
    """The one packet that was changed, and what it is without the fault; all frames of other transfers are equal."""
    (changed,) = shown(seen, rule)
    node = changed.first.src
    faulty, sound = packets(seen, "PUSHCAN", node), packets(usual(), "PUSHCAN", node)
    assert len(faulty) == len(sound)
    differing = [pair for pair in zip(faulty, sound, strict=True) if pair[0][1] != pair[1][1]]
    (((t, packet), (_, before)),) = differing
    assert t == changed.t
    assert sessions(seen, ("PUSHCAN", node)) == sessions(usual(), ("PUSHCAN", node))
    return packet, before


@pytest.mark.slow
def test_numbers_that_move_do_so_by_what_the_settings_say() -> None:
    for rule, number, by in (("PUSH-407", 26, -60), ("PUSH-405", 19, 27_315)):
        packet, before = lone(flight(rule), rule)
        assert word(packet, number) == word(before, number) + by
    packet, before = lone(flight("PUSH-409"), "PUSH-409")
    assert word(packet, 15) == pytest.approx(1.12 * word(before, 15), abs=1)


def test_a_packet_is_cut_short_or_followed_by_zeros() -> None:
    packet, before = lone(flight("PUSH-004"), "PUSH-004")
    assert packet == before[:24]
    packet, before = lone(flight("PUSH-004:by=9"), "PUSH-004")
    assert packet == before + bytes(9)


@pytest.mark.slow
def test_a_frame_count_jumps_once_and_goes_on_from_there() -> None:
    for order, name in (("PUSH-009", "PUSHCAN"), ("PUSH-009@1.5:type=PUSHSCI", "PUSHSCI")):
        seen = flight(order)
        (changed,) = shown(seen, "PUSH-009")
        unit = changed.payload[8]
        faulty, sound = packets(seen, name, changed.first.src), packets(usual(), name, changed.first.src)
        for (t, packet), (_, before) in zip(faulty, sound, strict=True):
            after = 7 if t >= changed.t and packet[4] == unit else 0
            assert (packet[3] - before[3]) % 256 == after


def test_a_big_endian_node_turns_every_number_round() -> None:
    node = answer(flight("PUSH-010"), "PUSH-010")["node"]
    faulty, sound = packets(flight("PUSH-010"), "PUSHCAN", node), packets(usual(), "PUSHCAN", node)
    assert len(shown(flight("PUSH-010"), "PUSH-010")) == len(faulty) == len(sound) > 10
    for (_, packet), (_, before) in zip(faulty, sound, strict=True):
        turned = bytearray(before)
        for at in WORDS[packet[2]]:
            turned[at : at + 2] = before[at : at + 2][::-1]
        assert packet == bytes(turned)
    assert sessions(flight("PUSH-010"), ("PUSHCAN", node)) == sessions(usual(), ("PUSHCAN", node))


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("order", "number", "wanted"),
    [
        ("PUSH-001:header=0x1234", 1, b"\x12\x34"),
        ("PUSH-007:value=0x99", 3, b"\x99"),
        ("PUSH-008:value=0xFE", 5, b"\xfe"),
        ("PUSH-402:value=65535", 8, b"\xff\xff"),
        ("PUSH-403:value=20000", 10, b"\x20\x4e"),
        ("PUSH-408:field=speed:value=-32767", 13, b"\x01\x80"),
        ("PUSH-101:field=position_loop:value=4", 23, b"\x01\x04"),
        ("PUSH-101:field=report_rate:value=500", 28, b"\xf4\x01"),
        ("PUSH-101:field=report_rate", 28, b"\x91\x01"),
        ("PUSH-101:field=bus_rate", 27, b"\x06"),
        ("PUSH-101:field=throttle_priority", 23, b"\x02\x00"),
        ("PUSH-101:field=position_loop", 23, b"\x01\x02"),
        ("PUSH-302:mode=0x11:value=3601", 7, b"\x11\x11\x0e"),
        ("PUSH-501:field=software_version:value=0x80", 23, b"\x80"),
        ("PUSH-502:field=bus_rate:value=7", 51, b"\x07"),
        ("PUSH-502:field=bus_rate", 51, b"\x06"),
        ("PUSH-502:field=report_rate", 52, b"\x91\x01"),
    ],
)
def test_settings_say_what_is_wrong(order: str, number: int, wanted: bytes) -> None:
    packet = shown(flight(order), order[:8])[-1].payload[4:]
    assert packet[number - 1 : number - 1 + len(wanted)] == wanted


@pytest.mark.slow
def test_settings_name_the_node_and_count_packets() -> None:
    for rule in ("PUSH-005", "PUSH-302"):
        seen = flight(f"{rule}@1.5:node=13:count=2")
        numbers = [set(found["frames"]) for found in seen.answers(rule)]
        found = [one for one in seen.log.transfers if any(one.numbers == some for some in numbers)]
        assert [one.payload[8] for one in found] == [0xA3, 0xA3]


def test_two_faults_leave_each_other_alone() -> None:
    seen = flight("PUSH-401@2", "PUSH-005@2", "PUSH-004@2", "PUSH-001@2")
    listed = [set(found["frames"]) for found in seen.key["faults"]]
    assert len(listed) == 4
    assert sum(map(len, listed)) == len(set().union(*listed))


def test_what_a_field_may_be_or_cannot_be_is_no_fault() -> None:
    orders = [f"{row.split()[0]}:{option}" for row in HARMLESS.split(";") for option in row.split()[1:]]
    seen = flight(*orders)
    assert sorted(seen.unused) == sorted(orders)
    assert seen.key["faults"] == []
    assert sessions(seen) == sessions(usual())


def test_a_runtime_that_falls_by_a_second_is_below_the_one_before() -> None:
    seen = flight("PUSH-407@2.9:by=1")
    (changed,) = shown(seen, "PUSH-407")
    sent = [packet for t, packet in packets(seen, "PUSHCAN", changed.first.src) if packet[2] == 0x15 and t <= changed.t]
    assert word(sent[-1], 26) == word(sent[-2], 26) - 1


def test_the_first_packet_falls_below_none_and_follows_on_none() -> None:
    seen = flight("PUSH-407@0", "PUSH-009@0")
    for rule in ("PUSH-407", "PUSH-009"):
        (found,) = (answer for answer in seen.key["faults"] if answer["rule"] == rule)
        (changed,) = (one for one in seen.log.transfers if one.numbers == set(found["frames"]))
        assert any(t < changed.t for t, _ in packets(seen, "PUSHCAN", changed.first.src))


def test_who_has_no_power_unit_sends_no_packets_either() -> None:
    orders = ("PUSH-010", "PUSH-103", "PUSH-301", "PUSH-401")
    seen = fly(*orders, seconds=SECONDS, seed=SEED, stock=True)
    assert not seen.log.of("PUSHCAN", "PUSHSCI")
    assert sorted(seen.unused) == sorted(orders)
    assert seen.key["faults"] == []


def test_a_single_esc_takes_another_place() -> None:
    seen = fly("PUSH-011", seconds=SECONDS, seed=SEED, escs=1)
    assert {packet[4] for _, packet in packets(seen, "PUSHCAN", 11)} == {0xA2}
    assert {packet[4] for _, packet in packets(seen, "PUSHSCI", GROUND)} <= {0xA2, 0xFF}
