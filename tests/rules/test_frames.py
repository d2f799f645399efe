"""Rules about single frames and identifiers: what fires them, where, and what is close to it but right."""

from __future__ import annotations

from dataclasses import replace

import pytest
from kit import VECTORS, encode
from kit.judged import agree, judge, whole
from kit.simulated import flight
from kit.traffic import MS, at, lines, push, status, tail, throttle

from analyzer.rules.frames.foreign import MOST_NAMED, protocol

RULES = tuple(f"CAN-{number:03}" for number in (1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 14, 15, 17, 18, 19))
VIOLATIONS = (VECTORS / "violations.log").read_text()
BATTERY = encode.Frame(0x351, bytes(8), extended=False)
ENGINE = encode.Frame(0x0CF00401, bytes.fromhex("F1A5A34050F3007D"))


def said(text: bytes, rule: str) -> list[tuple[str, int, str]]:
    """Severity, number of occurrences and text of each finding, the same for every batch."""
    return [(one.severity, one.count, one.text) for one in whole(text, (rule,), (7,))]


def telemetry(count: int = 4) -> list[encode.Frame]:
    return [frame for k in range(count) for frame in status(k).frames()]


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_a_fault_of_the_simulator_is_found_where_the_witness_finds_it(rule: str) -> None:
    agree(rule, flight(f"{rule}@1"))


def test_a_clean_flight_breaches_none() -> None:
    assert judge(flight(), RULES) == []


def test_the_examples_of_the_document() -> None:
    found = whole(VIOLATIONS, RULES, (1,))
    assert {(one.rule, one.first, one.text) for one in found if one.severity == "error"} == {
        ("CAN-006", 122, "service 1, destination 0"),
        ("CAN-005", 127, "1F040A0A with 0 data bytes"),
    }


def test_an_identifier_of_11_bits_is_one_finding() -> None:
    text = lines(telemetry(), [BATTERY] * 25, replace(BATTERY, id=0x355))
    assert said(text, "CAN-001") == [
        ("warning", 25, "identifier 351, 8 bytes"), ("warning", 1, "identifier 355, 8 bytes"),
    ]  # fmt: skip
    assert said(lines(telemetry()), "CAN-001") == []


def test_remote_and_empty_frames_count_in_traffic_that_is_dronecan() -> None:
    remote = replace(telemetry()[0], data=b"", remote=True, dlc=8)
    empty = replace(telemetry()[0], data=b"")
    text = lines(telemetry(), remote, empty)
    assert said(text, "CAN-002") == [("error", 1, f"remote frame {remote.id:08X}, asks for 8 bytes")]
    assert said(text, "CAN-005") == [("error", 1, f"{empty.id:08X} with 0 data bytes")]
    foreign = lines(telemetry(), [replace(ENGINE, data=b"", remote=True, dlc=8), replace(ENGINE, data=b"")])
    assert said(foreign, "CAN-002") == said(foreign, "CAN-005") == []


def test_frames_of_a_session_that_becomes_foreign_are_nothing() -> None:
    """Sixteen frames of a known identifier without one legal transfer."""
    junk = [tail(frame, 0x04) for frame in telemetry(8)]
    text = lines(telemetry(0), [replace(junk[0], data=b"")], junk)
    for rule in ("CAN-005", "TRF-005"):
        assert said(text, rule) == []
    assert [count for _, count, _ in said(text, "CAN-018")] == [25]


def test_fd_frames() -> None:
    long = status(0, fd=True).frames()
    assert said(lines(telemetry(), long), "CAN-003") == [("warning", 1, f"CAN FD frame of {len(long[0].data)} bytes")]
    assert said(lines(telemetry()), "CAN-003") == []
    stray = tail(long[0], 0x41)
    assert said(lines(telemetry(), stray), "CAN-003") == [("warning", 1, f"CAN FD frame of {len(stray.data)} bytes")]
    foreign = replace(ENGINE, data=bytes(11) + b"\x41", fd=True)
    assert said(lines(telemetry(), [foreign] * 20), "CAN-003") == []


def test_lengths_that_cannot_be() -> None:
    wrong = encode.Frame(telemetry()[0].id, bytes(12) + b"\xc5", fd=True)
    assert said(lines(telemetry(), wrong), "CAN-019") == [("error", 1, "13 data bytes")]
    assert said(lines(telemetry(), replace(wrong, data=wrong.data[1:])), "CAN-019") == []


def test_priorities_within_a_transfer() -> None:
    first, second, third = status(4).frames()
    odd = replace(second, id=second.id & 0xFF_FFFF | 30 << 24)
    text = lines(telemetry(), first, odd, third)
    assert said(text, "CAN-014") == [("error", 1, "priority 31 in the first frame, 30 in a later one")]
    lower = [replace(frame, id=frame.id & 0xFF_FFFF | 30 << 24) for frame in (first, second, third)]
    assert said(lines(telemetry(), lower), "CAN-014") == []


def test_anonymous_senders() -> None:
    ask = [encode.Frame(0x1E1C4100 + (k << 10), bytes([0, k, 2, 3, 0xC0 | k])) for k in range(5)]
    text = lines(telemetry(), ask)
    assert said(text, "CAN-008") == [("note", 5, "discriminator 0710, low type bits 1")]
    assert [count for _, count, _ in said(text, "CAN-010")] == [5]
    check = encode.crc16(bytes([0, 1, 2, 3]))
    good = encode.Frame(0x1E000100 | (check >> 1 & 0x3FFF) << 10, bytes([0, 1, 2, 3, 0xC0]))
    assert said(lines(telemetry(), [good] * 5), "CAN-010") == []
    assert said(lines(telemetry(), ask, tail(ask[0], 0x80)), "CAN-009") == [("error", 1, "tail byte 80 from source 0")]


def test_a_tool_that_reports_is_a_device() -> None:
    def of(node: int) -> list[encode.Frame]:
        return [replace(frame, id=frame.id & ~0x7F | node) for frame in (*telemetry(2), *throttle(0).frames())]

    assert said(lines(of(127)), "CAN-011") == [("warning", 2, "node 127 reports ESCStatus")]
    assert said(lines(of(125)), "CAN-011") == []
    orders = [replace(throttle(k).frames()[0], id=throttle(k).frames()[0].id & ~0x7F | 126) for k in range(9)]
    assert said(lines(orders), "CAN-011") == [("note", 1, "node 126 only asks and commands, as a tool does")]


def test_unknown_types_that_prove_themselves() -> None:
    sent = [encode.Frame(0x18514D2A, bytes([k, 0xC0 | k])) for k in range(5)]
    assert said(lines(telemetry(), sent), "CAN-015") == [("note", 5, "message type 20813 has no definition, 1 bytes")]
    assert said(lines(telemetry(), sent), "CAN-018") == []
    assert said(lines(telemetry(), sent[:2]), "CAN-015") == []


@pytest.mark.slow
def test_vendors_among_the_standard_types() -> None:
    text = flight("CAN-017@1")
    assert all("com.himark.servo" in line for _, _, line in said(text.encode(), "CAN-017"))


def test_foreign_identifiers_are_named_and_counted() -> None:
    text = lines(telemetry(), [ENGINE] * 700, [replace(ENGINE, id=0x901)] * 3, telemetry())
    assert said(text, "CAN-018") == [
        ("note", 700, "identifier 0CF00401, not DroneCAN, perhaps J1939: PGN 61444"),
        ("note", 3, "identifier 00000901, not DroneCAN, perhaps VESC: command 9"),
    ]


@pytest.mark.parametrize(("byte", "name"), [(0xE0, "Cyphal/CAN: its toggles start at 1"), (0x04, "not DroneCAN")])
def test_toggles_that_start_at_1_are_cyphal(byte: int, name: str) -> None:
    sent = [encode.Frame(0x107D552A, bytes([k, byte | k])) for k in range(20)]
    assert said(lines(telemetry(), sent), "CAN-018") == [("note", 20, f"identifier 107D552A, {name}")]


def test_foreign_identifiers_beyond_a_bound_share_one_finding() -> None:
    many = [replace(ENGINE, id=0x18F00001 + (k << 8)) for k in range(MOST_NAMED + 30)]
    found = said(lines(telemetry(), many), "CAN-018")
    assert len(found) == MOST_NAMED + 1
    assert found[-1][1] == 30
    assert f"beyond {MOST_NAMED}" in found[-1][2]


def test_foreign_frames_are_told_in_parts_as_they_would_be_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    many = [replace(ENGINE, id=0x18F00001 + (k % (MOST_NAMED + 30) << 8)) for k in range(5 * MOST_NAMED)]
    text = lines(telemetry(), many, [ENGINE] * 700)
    at_once = judge(text, ("CAN-018",))
    monkeypatch.setattr("analyzer.rules.frames.foreign._TOLD", 100)
    assert judge(text, ("CAN-018",)) == at_once
    assert sum(one.count for one in at_once) == len(many) + 700


@pytest.mark.parametrize(
    ("identifier", "cyphal", "name"),
    [
        (0x107D552A, True, "Cyphal/CAN"),
        (0x107D552A, False, "not DroneCAN"),
        (0x18FEEE01, True, "J1939: PGN 65262"),
        (0x18EA0003, False, "J1939: PGN 59904"),
        (0x00001B07, False, "VESC: command 27"),
        (0x0C010203, False, "not DroneCAN"),
    ],
)
def test_protocols_by_their_identifiers(identifier: int, cyphal: bool, name: str) -> None:
    assert protocol(identifier, cyphal=cyphal).endswith(name) or protocol(identifier, cyphal=cyphal).startswith(name)


@pytest.mark.slow
def test_a_proof_within_the_last_frames_clears_all_before() -> None:
    """Frames of an unknown type look foreign until three transfer IDs rise."""
    early = [encode.Frame(0x18514D2A, bytes([k, 0xC0 | k])) for k in (7, 9, 3, 4, 5)]
    text = lines(telemetry(), [at(MS * (50 + 40 * k), frame) for k, frame in enumerate(early)], push(1).frames())
    assert said(text, "CAN-018") == []
    assert [count for _, count, _ in said(text, "CAN-015")] == [5]
