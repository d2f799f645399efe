"""PUSH-001 to PUSH-011: what packets look like, against the witness and by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import VECTORS, encode
from kit.judged import judge, outcome, proved, said, whole
from kit.simulated import SEED, flight, fly
from kit.traffic import TURNING, capture, motor, summed
from witness import finder

from analyzer.rules import recent

if TYPE_CHECKING:
    from kit.traffic import Planned

FORM = ("PUSH-001", "PUSH-002", "PUSH-003", "PUSH-004", "PUSH-005", "PUSH-006", "PUSH-007", "PUSH-008", "PUSH-009")
QUERY = "PUSHSCI.FocQuery"


def push(*data: bytes, name: str = "PUSHCAN", gap: float = 20) -> str:
    """Messages of one node, 20 ms apart."""
    return capture((gap * k, 10, name, some) for k, some in enumerate(data))


@pytest.mark.slow
@pytest.mark.parametrize("rule", FORM)
def test_a_fault_is_found_where_the_witness_finds_it(rule: str) -> None:
    found = proved(rule, flight(f"{rule}@4", seconds=10))
    assert [one.count for one in found] == [1]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", [*FORM, "PUSH-010", "PUSH-011"])
def test_a_clean_flight_has_none(rule: str) -> None:
    assert said(rule, flight(seconds=10)) == []


def test_blocks_of_the_vectors() -> None:
    text = (VECTORS / "violations.log").read_text(encoding="ascii")
    found = [(one.rule, one.first, one.text) for one in judge(text, FORM) if one.first < 117]
    assert found == [
        ("PUSH-002", 89, "header 7B 8C inside PUSHSCI"),
        ("PUSH-005", 94, "checksum 00, sum 79"),
        ("PUSH-007", 99, "frame ID 0x16"),
        ("PUSH-009", 109, "expected 2, got 5 (per unit)"),
    ]


@pytest.mark.parametrize(
    ("rule", "data", "texts"),
    [
        ("PUSH-001", b"\x55\xaa" + motor(0), ["begins with 55 AA, header at byte 3"]),
        ("PUSH-001", b"\x55\xaa\x15", ["begins with 55 AA 15, header nowhere"]),
        ("PUSH-001", motor(0) + b"\x55", []),  # that is PUSH-004
        ("PUSH-001", b"", []),  # that is TYP-504
        ("PUSH-002", b"\xec\x96\x77", ["header EC 96 inside PUSHCAN"]),
        ("PUSH-003", motor(0)[:6], []),
        ("PUSH-004", motor(0)[:6], ["6 bytes for a length of 28"]),
        ("PUSH-004", motor(0)[:3], ["3 bytes for a length of unknown"]),
        ("PUSH-004", motor(0) + b"\x01\x02", ["30 bytes for a length of 28"]),
        ("PUSH-004", motor(0) + motor(1), []),
        ("PUSH-004", motor(0) + b"\x01" + motor(1) + b"\x02", ["29 bytes for a length of 28"] * 2),
        ("PUSH-005", summed(b"\x7b\x8c\x16\x00\xa1\x08\x07"), []),
        ("PUSH-005", b"\x7b\x8c\x16\x00\xa1\x08\x07\x00", ["checksum 00, sum CD"]),
        ("PUSH-007", b"\x7b\x8c\x06\x00\xa1\x07\x00", ["frame ID 0x06"]),
        ("PUSH-007", b"\x7b\x8c", []),
        ("PUSH-008", motor(0, 0xA9), []),
        ("PUSH-008", motor(0, 0xAA), ["unit 0xAA"]),
        ("PUSH-008", motor(0, 0xFF), ["unit 0xFF"]),
        ("PUSH-008", summed(b"\x7b\x8c\x16\x00\xa1\x08\x07"), []),  # of an unknown frame ID too
        ("PUSH-008", summed(b"\x7b\x8c\x16\x00\xaa\x08\x07"), ["unit 0xAA"]),
    ],
)
def test_data_of_one_message(rule: str, data: bytes, texts: list[str]) -> None:
    assert [one.text for one in said(rule, push(data)) for _ in range(one.count)] == texts


def test_a_wrong_length_stands_with_the_right_one() -> None:
    whole = bytearray(motor(0))
    whole[5] = 27
    text = push(summed(bytes(whole[:-1])))
    assert [one.text for one in said("PUSH-003", text)] == ["length 27, 28 for frame ID 0x15"]
    assert said("PUSH-005", text) == []  # judged in packets of the right length only


def test_only_a_query_goes_to_all_units() -> None:
    query, setting = encode.packet(QUERY, 0, 0xFF), encode.packet("PUSHSCI.SetZero", 1, 0xFF)
    (one,) = said("PUSH-008", push(query, setting, name="PUSHSCI"))
    assert (one.frames, one.text) == ((3,), "unit 0xFF")


@pytest.mark.parametrize(("end", "count"), [(28, 1), (None, 0)])
def test_the_printed_range_of_the_sum(end: int | None, count: int) -> None:
    values = {"bus_rate": 1, "report_rate": 50, "save_option": 1}
    packet = encode.packet("PUSHSCI.FocParameters", 0, 0xA1, end, **values)
    assert len(said("PUSH-006", push(packet, name="PUSHSCI"))) == count
    assert said("PUSH-005", push(packet, name="PUSHSCI")) == []


def test_a_damaged_transfer_says_nothing() -> None:
    text = push(b"\x55\xaa" + motor(0))
    assert judge(text, FORM) != []
    assert judge(text.replace("#AA", "#AB", 1), FORM) == []


def foc(count: int, unit: int = 0xA1) -> bytes:
    return encode.packet("PUSHCAN.FocFeedback", count, unit, hardware_version=b"H", software_version=b"S")


@pytest.mark.sampled(6)
@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize("pairs", [6, 60])
def test_counts_of_each_frame_id(step: int | None, pairs: int) -> None:
    data = [one for k in range(pairs) for one in (motor(k), foc(k))]
    assert said("PUSH-009", push(*data), step) == []
    data += [motor(pairs + 3), foc(pairs)]
    found = said("PUSH-009", push(*data), step)
    assert [one.text for one in found] == [f"expected {pairs}, got {pairs + 3} (per frame ID)"]
    assert [one.count for one in found] == [1]


@pytest.mark.sampled(6)
@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize("pairs", [6, 60])
def test_counts_of_a_unit(step: int | None, pairs: int) -> None:
    data = [one for k in range(pairs) for one in (motor(2 * k % 256), foc((2 * k + 1) % 256))]
    assert said("PUSH-009", push(*data), step) == []
    data.append(motor(2 * pairs + 1))
    found = said("PUSH-009", push(*data), step)
    assert [one.text for one in found] == [f"expected {2 * pairs}, got {2 * pairs + 1} (per unit)"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("step", [None, 1, 7])
@pytest.mark.parametrize("rounds", [4, 40])
def test_a_count_over_all_packets_of_a_sender(step: int | None, rounds: int) -> None:
    """Cyclic, whatever the unit: by unit every one of them would jump."""
    units = [0xA1, 0xA2, 0xA3, 0xA4]
    data = [(motor, foc)[k % 7 == 6](k % 256, units[k % 4]) for k in range(4 * rounds)]
    assert said("PUSH-009", push(*data), step) == []
    assert said("PUSH-009", push(*data[:9], *data[10:]), step) != []
    assert said("PUSH-009", without(data, 9), step) == []
    jump = motor((4 * rounds + 3) % 256, 0xA1)
    (found,) = said("PUSH-009", push(*data, jump), step)
    assert (found.count, found.text) == (1, f"expected {4 * rounds % 256}, got {(4 * rounds + 3) % 256} (per sender)")


@pytest.mark.parametrize("rounds", [6, 40])
def test_a_count_for_each_frame_id_of_a_sender(rounds: int) -> None:
    units = [0xA1, 0xA2, 0xA3]
    data = [one(k, units[k % 3]) for k in range(rounds) for one in (motor, foc)]
    assert said("PUSH-009", push(*data)) == []
    (found,) = said("PUSH-009", push(*data, motor(rounds + 1, 0xA1)))
    assert found.text == f"expected {rounds}, got {rounds + 1} (per frame ID of the sender)"


def test_a_new_unit_that_happens_to_go_on_is_no_count_of_the_sender() -> None:
    """A part of a capture has few packets; what no unit breaks needs no other reading."""
    counts = {0xA1: (1, 2, 3), 0xA2: (1, 2, 3), 0xA3: (4, 5, 6), 0xA4: (7, 8, 9)}
    data = [(motor, foc)[count % 2](count, unit) for unit, own in counts.items() for count in own]
    assert said("PUSH-009", push(*data)) == []
    (found,) = said("PUSH-009", push(*data, motor(11, 0xA4)))
    assert found.text == "expected 10, got 11 (per unit)"


@pytest.mark.parametrize("step", [None, 1])
@pytest.mark.parametrize(("quiet", "severity"), [(2000, "warning"), (2001, "note")])
def test_a_count_after_a_silence_is_a_note(step: int | None, quiet: int, severity: str) -> None:
    """As the transfer IDs then are; others talk meanwhile."""
    times = [*(20 * k for k in range(9)), 160 + quiet, 180 + quiet]
    sent = [(t, 10, "PUSHCAN", motor(k if k < 9 else k + 40)) for k, t in enumerate(times)]
    others = [(500 * k + 5, 11, "PUSHCAN", motor(k)) for k in range(8)]
    (found,) = said("PUSH-009", capture((*sent, *others)), step)
    assert (found.severity, found.count, found.text) == (severity, 1, "expected 9, got 49 (per unit)")


def test_a_count_wraps_and_units_count_alone() -> None:
    data = [motor(count % 256, unit) for count in range(250, 260) for unit in (0xA1, 0xA2)]
    assert said("PUSH-009", push(*data)) == []


@pytest.mark.parametrize("step", [None, 3])
@pytest.mark.parametrize("kept", [False, True])
def test_lost_transfers_explain_counts(step: int | None, *, kept: bool) -> None:
    """Without transfers 3 and 4 nothing is said; if the transfer IDs go on, or more is missing, it is."""
    lines = push(*(motor(count) for count in range(8))).splitlines(keepends=True)
    size = len(lines) // 8
    text = "".join(lines[: 3 * size] + lines[5 * size :])
    assert said("PUSH-009", text, step) == []
    more = push(*(motor(count if count < 3 else count + 2 + kept) for count in range(8))).splitlines(keepends=True)
    found = said("PUSH-009", "".join(more), step)
    assert [one.text for one in found] == [f"expected 3, got {5 + kept} (per unit)"]


def without(data: list[bytes], lost: int) -> str:
    """Messages of node 10, of which one is not there."""
    whole: list[str] = []
    for line in push(*data).splitlines(keepends=True):
        if int(line.split()[2][-2:], 16) & 0x80:
            whole.append("")
        whole[-1] += line
    return "".join(whole[:lost] + whole[lost + 1 :])


@pytest.mark.slow
@pytest.mark.parametrize("step", [None, 3])
def test_a_loss_counts_up_to_the_next_packet_that_is_counted_along(step: int | None) -> None:
    """By frame ID a packet in between hides no loss; by unit a loss before it explains nothing behind it."""
    by_id = [one(k) for k in range(30) for one in (motor, foc)]
    assert said("PUSH-009", without(by_id, 40), step) == []  # motor(20), then foc(20) and motor(21)
    by_unit = [(motor, foc, foc)[k % 3](k + (k > 41)) for k in range(60)]
    found = said("PUSH-009", without(by_unit, 40), step)  # foc(40), then foc(41) and motor(43)
    assert [one.text for one in found] == ["expected 42, got 43 (per unit)"]


def cut(data: list[bytes], at: int, frames: slice, gap: float = 100) -> str:
    """Packets in messages of node 10, of which one keeps only some frames; all messages are of equal length."""
    lines = push(*data, gap=gap).splitlines(keepends=True)
    size = len(lines) // len(data)
    lines[at * size : (at + 1) * size] = lines[at * size : (at + 1) * size][frames]
    return "".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize("frames", [slice(0, 4), slice(0, 1), slice(1, None), slice(2, None)])
@pytest.mark.parametrize("gap", [20, 100, 2100])
def test_a_broken_transfer_explains_its_packet_whenever_it_is_given_up(frames: slice, gap: float) -> None:
    text = cut([motor(count) for count in range(60)], 20, frames, gap)
    assert {one.rule[:3] for one in whole(text, ("PUSH-009", "TRF-005", "TRF-006", "TRF-007"))} == {"TRF"}


@pytest.mark.slow
@pytest.mark.parametrize("jump", [18, 22, 39, 40, 41, 45])
def test_a_broken_transfer_explains_no_other_jump(jump: int) -> None:
    """That of 2.0 s comes out between two good ones, which count on."""
    text = cut([motor(count + (count >= jump)) for count in range(80)], 20, slice(0, 4))
    (one,) = whole(text, ("PUSH-009",))
    assert (one.count, one.text) == (1, f"expected {jump}, got {jump + 1} (per unit)")


@pytest.mark.slow
def test_a_breach_that_was_held_back_still_shows_its_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recent, "KEPT", 40)
    text = cut([motor(count + (count >= 30)) for count in range(80)], 20, slice(0, 4))
    for step in (None, 1, 7):
        ((_, run),) = outcome(text, ("PUSH-009",), step).runs
        (example,) = run.examples
        lines = text.splitlines()
        shown = [lines[frame].split()[2] for frame in example.frames]
        assert [line.split()[2] for line in example.lines] == shown
        assert len(shown) > 1


def test_messages_in_another_order_count_as_they_were_sent() -> None:
    lines = push(*(motor(count) for count in range(12))).splitlines(keepends=True)
    size = len(lines) // 12
    moved = [lines[k * size : (k + 1) * size] for k in (0, 1, 2, 3, 5, 4, 6, 7, 8, 9, 10, 11)]
    stamps = [line.split()[0] for line in lines]
    sent = [line.split(maxsplit=1)[1] for message in moved for line in message]
    text = "".join(f"{stamp} {line}" for stamp, line in zip(stamps, sent, strict=True))
    assert not whole(text, ("PUSH-009",))
    kept = push(*(motor(count) for count in (0, 1, 2, 3, 5, 4, 6, 7)))
    assert [one.count for one in whole(kept, ("PUSH-009",))] == [3]


def test_a_damaged_packet_explains_a_count() -> None:
    unknown = bytearray(motor(1))
    unknown[2] = 0x16
    assert said("PUSH-009", push(motor(0), summed(bytes(unknown[:-1])), motor(2))) == []


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["PUSH-010", "PUSH-011"])
def test_what_holds_for_a_node_is_said_once(rule: str) -> None:
    found, witness = whole(flight(rule), (rule,), (401,)), fly(rule, seconds=4, seed=SEED)
    assert {one.node for one in found} >= {answer["node"] for answer in witness.answers(rule)}
    assert {frame for one in found for frame in one.frames} <= set().union(*finder(rule)(witness.log))
    assert len({(one.node, one.text) for one in found}) == len(found) > 0
    assert all(one.count == 1 and one.severity == "note" for one in found)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", [None, 1, 7])
def test_a_new_index_is_a_new_pair(step: int | None) -> None:
    def sent(at: float, index: int) -> list[Planned]:
        return [(at, 10, "ESCStatus", TURNING | {"esc_index": index}), (at + 1, 10, "PUSHCAN", motor(int(at), 0xA2))]

    text = capture(one for at, index in ((0, 1), (10, 0), (20, 0), (30, 1), (40, 3)) for one in sent(at, index))
    found = said("PUSH-011", text, step)
    assert [(one.key, one.count, len(one.frames), one.text) for one in found] == [
        ("unit_id=162", 2, 2, "unit 0xA2 is index 0")
    ]
