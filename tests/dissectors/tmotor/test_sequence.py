"""Sequence numbers of PUSHSCI and PUSHCAN: gaps, repetitions, restarts."""

from __future__ import annotations

from itertools import count

import pytest
from kit import encode
from kit.judged import exact, judge, whole
from kit.simulated import flight
from kit.traffic import MS, START, log

RULES = ("TYP-501", "TYP-502", "TYP-503", "TYP-504")
DATA = [0x7B, 0x8C, 0x15]


def capture(*sent: tuple[int, int, int], data: list[int] | None = None, broken: int = -1) -> str:
    """Transfers of a node: (transfer ID, sequence, ms); each has data of its own unless `data` is given."""
    text, fresh = "", count()
    for k, (number, sequence, t) in enumerate(sent):
        fields = {"data_sequence": sequence, "data": data or [*DATA, next(fresh)]}
        frames = encode.transfer("PUSHCAN", fields, 11, number).frames(START + t * MS)
        if k == broken:
            frames = frames[:1]
        text += "".join(encode.log_line(frame) + "\n" for frame in frames)
    return text


def told(*sent: tuple[int, int, int], **more: int) -> list[tuple[str, str]]:
    return [(one.rule, one.text) for one in whole(capture(*sent, **more), RULES)]


@pytest.mark.sampled(7)
@pytest.mark.parametrize(
    ("order", "severity", "text"),
    [
        ("TYP-501", "warning", "expected 11, got 15"),
        ("TYP-501:missing=32", "warning", "expected 11, got 43"),
        ("TYP-501:missing=1000:type=PUSHSCI", "warning", "expected 9, got 1009"),
        ("TYP-502", "warning", "10 again, other data"),
        ("TYP-502:type=PUSHSCI", "warning", "8 again, other data"),
        ("TYP-503", "note", "10, then 0"),
        ("TYP-504", "note", "sequence 12, no data"),
        ("TYP-504:type=PUSHSCI", "note", "sequence 10, no data"),
    ],
)
def test_a_fault_is_found_where_it_is(order: str, severity: str, text: str) -> None:
    (one,) = exact(order[:7], flight(order))
    assert (one.severity, one.count, one.text) == (severity, 1, text)


def test_a_sound_flight_is_clean() -> None:
    assert not judge(flight(escs=5), RULES)


def test_transfers_that_did_not_arrive_explain_their_numbers() -> None:
    assert not told((0, 5, 0), (1, 6, 20), (4, 9, 80))
    assert told((0, 5, 0), (3, 9, 80)) == [("TYP-501", "expected 8, got 9")]
    assert not told((30, 5, 0), (3, 10, 100)), "transfer IDs wrap"
    assert not told((0, 5, 0), (1, 6, 20), (2, 7, 40), broken=1)
    assert told((0, 5, 0), (1, 6, 20), (2, 8, 40), broken=1) == [("TYP-501", "expected 7, got 8")]


def test_after_a_pause_any_number_that_fits_the_transfer_id_will_do() -> None:
    assert told((0, 5, 0), (2, 39, 2000)) == [("TYP-501", "expected 7, got 39")]
    assert not told((0, 5, 0), (2, 39, 2001))
    assert told((0, 5, 0), (2, 40, 2001)) == [("TYP-501", "expected 7, got 40")]


def test_a_wrap_is_no_restart() -> None:
    assert not told((0, 0xFFFFFFFF, 0), (1, 0, 20), (2, 1, 40))
    assert told((0, 0xFFFFFFFE, 0), (1, 0, 20)) == [("TYP-501", "expected 4294967295, got 0")]
    assert told((0, 5120, 0), (1, 0, 20)) == [("TYP-503", "5120, then 0")]


def test_transfers_in_another_order_are_no_restart() -> None:
    moved = [(5, 15), (7, 17), (6, 16), (8, 18)]
    assert not told(*((number, sequence, k * 20) for k, (number, sequence) in enumerate(moved)))
    assert told((5, 15, 0), (7, 17, 20), (6, 15, 40)) == [("TYP-503", "17, then 15")]
    assert told((0, 0, 0), (1, 1, 20), (0, 0, 40)) == [("TYP-503", "1, then 0")]
    assert told((9, 19, 0), (0, 10, 20)) == [("TYP-503", "19, then 10")]


def test_the_same_data_again_is_a_note() -> None:
    (one,) = whole(capture((0, 5, 0), (1, 5, 20), data=DATA), RULES)
    assert (one.severity, one.text) == ("note", "5 again, the same data")
    (one,) = whole(capture((0, 5, 0), (1, 5, 20)), RULES)
    assert (one.severity, one.text) == ("warning", "5 again, other data")


def test_each_node_counts_on_its_own() -> None:
    def sent(k: int, node: int, first: int) -> encode.Transfer:
        return encode.transfer("PUSHCAN", {"data_sequence": first + k, "data": DATA}, node, k)

    both = [(k * 40 + late, sent(k, *who)) for k in range(6) for late, who in ((0, (11, 0)), (20, (12, 90)))]
    assert not whole(log(*both), RULES)


def test_a_gap_beside_lost_frames_is_a_note() -> None:
    text = capture((0, 5, 0), (1, 6, 20))
    gap = capture((2, 9, 40))
    drop = "(1700000000.030000) can0 20000004#0001000000000000\n"  # the controller's receive buffer ran over
    (alone,) = judge(text + gap, RULES)
    (beside,) = judge(text + drop + gap, RULES)
    assert (alone.severity, beside.severity) == ("warning", "note")
