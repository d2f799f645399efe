"""The details of a transfer: every field, its bits, and where they came from."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit import VECTORS, encode
from kit.traffic import START, Traffic, lines, push, status, throttle

from analyzer.views.details.hexdump import tail_words
from analyzer.views.details.tree import Tree
from analyzer.views.times import TimeFormat

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry


def details(got: Any, registry: Registry, **more: Any) -> list[list[str]]:
    tree = Tree(registry, TimeFormat(), **more)
    return [text.split("\n")[:-1] for batch in got.batches for text in tree.texts(batch)]


@pytest.fixture(scope="module")
def golden(decode: Callable[..., Any], registry: Registry) -> dict[str, list[str]]:
    """Details by the number of the first frame."""
    found = details(decode((VECTORS / "tm_golden.log").read_bytes()), registry)
    return {entry[0].split("frame")[1].strip("s ").split(",")[0].split()[0]: entry for entry in found}


def has(entry: list[str], *texts: str) -> bool:
    """Whether these lines stand in the details, blanks at both ends and runs of them not counted."""
    there = {" ".join(line.split()) for line in entry}
    missing = [text for text in texts if " ".join(text.split()) not in there]
    assert not missing, "\n".join([*missing, "--", *entry])
    return True


def test_esc_status_down_to_its_bits(golden: dict[str, list[str]]) -> None:
    assert has(
        golden["57"],
        "Identifier 1F040A0D",
        "1 1111 .... .... .... .... .... .... = priority: 31",
        ". .... 0000 0100 0000 1010 .... .... = message type: 1034 (ESCStatus)",
        ". .... .... .... .... .... .000 1101 = source node: 13",
        "Transfer: ok",
        "CRC: 860F, computed 860F: good",
        "status (error_count): 536821760 (0x1FFF4000) bytes 1-4 clause 4.4.3 no 1-4",
        ".... .... .... .... .... .... 0... .... = stall: not set",
        ".... .... .... .... 0100 .... .... .... = mode: 4 (operating)",
        "0001 1111 1111 1111 .... .... .... .... = encoder: 179.978 deg (raw 8191)",
        "voltage: 48.5 V (raw 0x5210) bytes 5-6 clause 4.4.3 no 5-6",
        "rpm: 5230 rpm byte 11 bit 7 to byte 13 bit 6 clause 4.4.3 no 11-13",
        "esc_index: 3 byte 14 bits 6-2 clause 4.4.3 no 14",
        "[channel: 4, from esc_index] clause 4.4.3 no 14",
    )


def test_packets_inside(golden: dict[str, list[str]]) -> None:
    assert has(
        golden["150"],
        "data_sequence: 2 bytes 1-4 clause 4.4.5 no 1-4",
        "Packet MotorStatus (from byte 5, clause 4.4.5 table 1)",
        "verdict: header of this direction, length good, checksum good (bytes 1 to 27)",
        "position: 180 deg (raw 18000) bytes 12-13 clause 4.4.5 table 1 no 8-9",
        "system_status: 0 (no rotor lock) byte 11 clause 4.4.5 table 1 no 7",
        ".... .... .... ...0 = over_voltage: not set (tentative name)",
        "[unit: 1, from unit_id] clause 4.4.5 table 1 no 5",
    )
    assert has(golden["149"], "Unrecognised data from byte 5, no header: 7B")
    assert has(golden["160"], 'software_version: 53 57 2D 56 32 2E 32 2E 33 00 00 00 00 00 00 00 "SW-V2.2.3" '
                              "bytes 27-42 clause 4.4.5 table 2 no 23-38")  # fmt: skip


def test_packets_stand_behind_the_length_of_their_field(decode: Callable[..., Any], registry: Registry) -> None:
    packet = encode.packet("PUSHCAN.MotorStatus", 1, 0xA1, voltage=5000)
    sent = encode.transfer("PUSHCAN", {"data_sequence": 7, "data": list(packet)}, 10, fd=True)
    (entry,) = details(decode(lines(sent.frames(START))), registry)
    assert has(
        entry,
        "Packet MotorStatus (from byte 6, clause 4.4.5 table 1)",
        "unit_id: 161 (0xA1) byte 10 clause 4.4.5 table 1 no 5",
        "voltage: 50 V (raw 5000) bytes 20-21 clause 4.4.5 table 1 no 15-16",
    )


def test_values_in_lists_whose_unit_another_field_gives(decode: Callable[..., Any], registry: Registry) -> None:
    of = registry.resolve("uavcan.equipment.actuator.ArrayCommand")
    sent = encode.Transfer("message", of.type_id, 10, bytes.fromhex("03010038"), of.signature, 0)
    (entry,) = details(decode(lines(sent.frames(START))), registry)
    assert has(
        entry, "commands: 1 elements bytes 1-4", "commands[0] bytes 1-4", "command_value: 0.5 (raw 0x3800) bytes 3-4"
    )


def test_special_values_have_their_name(golden: dict[str, list[str]]) -> None:
    assert has(golden["24"], "esc_uuid: 4294967295 (all) (0xFFFFFFFF) bytes 2-5 clause 4.4.2 no 2-5",
               "esc_can_rate: 255 (no change) byte 24 clause 4.4.2 no 24")  # fmt: skip


def test_services_and_anonymous_identifiers(decode: Callable[..., Any], registry: Registry) -> None:
    found = details(decode((VECTORS / "neighbours.log").read_bytes()), registry)
    by_title = {entry[0]: entry for entry in found}
    assert has(
        by_title["GetSet on can0, frames 14, 15, 16, 17 (4)"],
        "Identifier 180B018A",
        ". .... .... .... 0... .... .... .... = direction: response",
        ". .... .... .... .000 0001 .... .... = destination node: 1",
        "integer_value: 3 bytes 2-9",
        'name: 65 73 63 5F 69 6E 64 65 78 "esc_index" bytes 13-21',
    )
    assert has(
        by_title["Allocation on can0, frame 18 (1)"],
        ". .... .... .... .... .... .000 0000 = source node: 0 (anonymous)",
    )


def test_broken_transfers_show_their_bytes(decode: Callable[..., Any], registry: Registry) -> None:
    lost = status(1).frames()
    entries = details(decode(lines(status(0).frames(), lost[:1], lost[2:], status(2).frames())), registry)
    (broken,) = [entry for entry in entries if "    Transfer: interrupted" in entry]
    assert any(line.startswith("    Payload, not decoded: ") for line in broken)
    assert any("! frame missing or out of order (toggle)" in line for line in broken)


def test_bad_sums_are_told(decode: Callable[..., Any], registry: Registry) -> None:
    frames = push(0).frames()
    wrong = replace(frames[1], data=bytes([frames[1].data[0] ^ 1]) + frames[1].data[1:])
    (entry,) = details(decode(lines([frames[0], wrong], frames[2:])), registry)
    assert any(line.endswith(": BAD") for line in entry)


def test_payloads_that_do_not_fit_are_told(decode: Callable[..., Any], registry: Registry) -> None:
    short = encode.Frame(0x1F040A0A, bytes(7) + b"\xc0")
    (entry,) = details(decode(lines([short])), registry)
    assert has(entry, "! 54 bits are missing behind 7 bytes", "voltage: 0 V (raw 0x0000) bytes 5-6 clause 4.4.3 no 5-6",
               "current: missing bytes 7-8 clause 4.4.3 no 7-8")  # fmt: skip


def test_only_the_types_asked_for_in_full(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), status(0).frames()))
    first, second = details(got, registry, only=["ESCStatus"])
    assert first == ["RawCommand on can0, frame 1 (1)"]
    assert len(second) > 20


def test_missing_times_are_told(decode: Callable[..., Any], registry: Registry) -> None:
    (entry,) = details(decode(lines(throttle(0).frames(), timed=False)), registry)
    assert has(entry, "time: not recorded")


def test_tail_words() -> None:
    assert [tail_words(byte) for byte in (0xC5, 0x80, 0x3F)] == [
        "start end toggle 0 ID 5",
        "start toggle 0 ID 0",
        "toggle 1 ID 31",
    ]


def test_a_big_endian_packet_shows_its_numbers_as_they_were_read(
    decode: Callable[..., Any], registry: Registry
) -> None:
    traffic = Traffic()
    for _ in range(4):
        traffic.status(11)
        traffic.motor(11, big=True, position=0x1234)

    def shown(start: str, *, ahead: bool) -> list[str]:
        entries = details(decode(traffic.log, ahead=ahead), registry)
        found = [" ".join(line.split()) for entry in entries for line in entry]
        return [line.partition(" byte")[0] for line in found if line.startswith(start)]

    orders = [
        "byte order: undecided, read as little-endian",
        "byte order: big-endian, as this node's other messages show",
    ]
    positions = ["position: 133.3 deg (raw 13330)", "position: 46.6 deg (raw 4660)"]
    assert shown("byte order:", ahead=False) == orders[:1] * 3 + orders[1:]
    assert shown("position:", ahead=False) == positions[:1] * 3 + positions[1:]
    assert shown("byte order:", ahead=True) == orders[1:] * 4
    assert shown("position:", ahead=True) == positions[1:] * 4


def test_a_doubtful_field_is_shown_as_its_node_means_it(decode: Callable[..., Any], registry: Registry) -> None:
    traffic = Traffic()
    traffic.status(10, temperature=40.0, error_count=4 << 12 | 4)
    traffic.status(11, temperature=300.0, error_count=4)

    def shown(**how: Any) -> list[list[str]]:
        entries = details(decode(traffic.log, **how), registry)
        return [[line.strip() for line in entry if "over_current" in line or "read as" in line] for entry in entries]

    part = ".... .... .... .... .... .... .... .1.. = over_current: set"
    assert shown(ahead=True) == [["[read as tm]", part, "[read as degC]"], ["[read as dronecan]", "[read as K]"]]
    assert shown() == [["[read as tm]", part], ["[read as dronecan so far]"]]
    assert shown(ahead=True, forced={11: ["tm", "degC"]})[1] == ["[read as tm]", part, "[read as degC]"]
