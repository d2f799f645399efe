"""Rules about the frames of one transfer: what fires them, where, and what is close to it but right."""

from __future__ import annotations

from dataclasses import replace

import pytest
from kit import VECTORS, encode
from kit.judged import agree, judge, outcome, whole
from kit.simulated import flight
from kit.traffic import MS, SECOND, at, lines, push, retail, status, tail, throttle

RULES = tuple(f"TRF-{number:03}" for number in (1, 2, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 26, 27, 29))
VIOLATIONS = (VECTORS / "violations.log").read_text()
TOGGLE, LATE = 0x20, 5 * SECOND


def said(text: bytes, rule: str) -> list[tuple[str, int, int, str]]:
    """Severity, number of occurrences, first frame and text of each finding, the same for every batch."""
    return [(one.severity, one.count, one.first, one.text) for one in whole(text, (rule,), (7,))]


def evidence(text: bytes, rule: str) -> list[tuple[int, ...]]:
    """The frames of the first example of each finding."""
    return [tuple(frame + 1 for frame in run.examples[0].frames) for _, run in outcome(text, (rule,)).runs]


def usual(count: int = 4) -> list[encode.Frame]:
    return [frame for k in range(count) for frame in status(k).frames()]


def awake(since: int, until: int) -> list[encode.Frame]:
    """Throttle every 500 ms, so that the capture has no gap."""
    return [at(t, throttle(k % 32).frames()[0]) for k, t in enumerate(range(since, until, 500 * MS))]


PAUSE = awake(500 * MS, LATE)


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_a_fault_of_the_simulator_is_found_where_the_witness_finds_it(rule: str) -> None:
    agree(rule, flight(f"{rule}@1", seconds=5))


def test_a_clean_flight_breaches_none() -> None:
    assert judge(flight(), RULES) == []


def test_the_examples_of_the_document() -> None:
    found = whole(VIOLATIONS, RULES, (1,))
    assert {(one.rule, frame) for one in found for frame in one.frames} == {
        ("TRF-001", 8), ("TRF-006", 9), ("TRF-006", 14), ("TRF-006", 20), ("TRF-007", 25),
        ("TRF-005", 26), ("TRF-012", 42), ("TRF-013", 42), ("TRF-015", 46), ("TRF-026", 50), ("TRF-026", 51),
    }  # fmt: skip


def test_toggles_that_start_at_1() -> None:
    throttles = [throttle(k).frames()[0] for k in range(4)]
    single = lines(throttles, retail(throttle(4).frames()[0], TOGGLE))
    assert said(single, "TRF-001") == [("error", 1, 5, "tail byte E4, toggle 1 in a single frame")]
    assert said(lines(throttles), "TRF-001") == []
    wrong = [retail(frame, TOGGLE) for frame in status(4).frames()]
    assert said(lines(usual(), wrong), "TRF-002") == [("error", 1, 13, "first tail byte A4")]
    begun = [retail(frame, TOGGLE) for frame in status(0).frames()]  # before anything proves the session
    assert said(lines(begun, usual()[3:]), "TRF-002") == [("error", 1, 1, "first tail byte A0")]
    assert said(lines(usual()), "TRF-002") == []


def test_copies_inside_a_transfer() -> None:
    first, second, third = status(4).frames()
    for copied in ((first, first, second, third), (first, second, second, third)):
        place = 14 if copied[1] is first else 15
        text = f"frame {place} repeats frame {place - 1}"
        assert said(lines(usual(), list(copied)), "TRF-004") == [("warning", 1, place, text)]
    assert said(lines(usual(), [throttle(1).frames()[0]] * 2), "TRF-004") == []


def test_what_is_left_without_a_start_is_one_occurrence() -> None:
    _, *rest = push(4).frames()
    later = [at(LATE + k * MS, frame) for k, frame in enumerate(rest)]
    before = [frame for k in range(4) for frame in push(k).frames()]
    wanted = "transfer ID 4, first frame lost (of 5)"
    assert said(lines(before, PAUSE, later), "TRF-005") == [("error", 1, 21 + len(PAUSE), wanted)]
    assert said(lines(before, later), "TRF-005") == [("note", 1, 21, wanted)]  # it began in a gap of the capture
    assert said(lines(before, rest), "TRF-005") == [("note", 1, 21, "transfer ID 4, first frame lost (of 5)")]
    new = [at(LATE + 20 * MS + k * MS, frame) for k, frame in enumerate(usual(1)[1:] + usual(3)[3:])]
    assert said(lines(before, new), "TRF-005") == [("note", 1, 21, "transfer ID 0, first frame lost (of 3)")]
    assert said(lines(before), "TRF-005") == []


def test_frames_that_the_recorder_lost_explain_a_missing_start_and_a_missing_end() -> None:
    _, *rest = push(4).frames()
    spaced = [at(LATE // 10 * 9 * k + n * MS, frame) for k in range(2) for n, frame in enumerate(push(k).frames())]
    spaced[5:5] = PAUSE[:-1]
    later = [at(LATE + 100 * MS + k * MS, frame) for k, frame in enumerate([*rest, *push(5).frames()[:3]])]
    last = [at(LATE + 110 * MS + k * MS, frame) for k, frame in enumerate(push(5).frames())]
    text = lines(spaced, later, last)
    lost = encode.drop_line("can0", 3, 3).encode() + b"\n"
    for rule in ("TRF-005", "TRF-006"):
        assert [severity for severity, *_ in said(text, rule)] == ["error"]
        assert [severity for severity, *_ in said(text + lost, rule)] == ["note"]


def test_a_transfer_that_another_one_leaves_behind() -> None:
    cut = push(4).frames()[:2]
    text = lines([frame for k in range(4) for frame in push(k).frames()], cut, push(4).frames())
    wanted = "2 frames, 14 bytes received, never complete: last frames lost (the 3rd to 5th of 5)"
    assert said(text, "TRF-006") == [("error", 1, 21, wanted)]
    assert said(lines(usual()), "TRF-006") == []


def test_a_stray_frame_is_evidence_of_a_broken_sequence_only() -> None:
    """One with the ID of the transfer that does not fit into it: the 3rd, with other bytes."""
    first, second, third, *rest = push(4).frames()
    before = [frame for k in range(4) for frame in push(k).frames()]
    stray = replace(third, data=bytes([third.data[0] ^ 0xFF, third.data[1] ^ 0x5A]) + third.data[2:])
    broken = lines(before, [first, second, *rest, stray], push(5).frames())
    assert evidence(broken, "TRF-003") == [(21, 22, 23, 24, 25)]
    cut = lines(before, [stray, first, second], push(5).frames())
    assert evidence(cut, "TRF-006") == [(22, 23)]


@pytest.mark.parametrize(
    ("after", "wanted"),
    [
        (2500 * MS, [("warning", 1, 13, "2.00 s since the first frame: last frame lost (the 3rd of 3)")]),
        (1500 * MS, [("note", 1, 13, "1.50 s since the first frame")]),
        (900 * MS, []),
    ],
)
def test_transfers_that_take_long(after: int, wanted: list[tuple[str, int, int, str]]) -> None:
    first, second, third = status(4).frames()
    later = at(LATE + 3 * SECOND, status(5).frames()[0])
    meanwhile, then = awake(LATE + 500 * MS, LATE + after), awake(LATE + after + 400 * MS, LATE + 3 * SECOND)
    text = lines(usual(), PAUSE, at(LATE, first), second, meanwhile, at(LATE + after, third), then, later)
    first_at = 13 + len(PAUSE)
    assert said(text, "TRF-007") == [(*one[:2], first_at, one[3]) for one in wanted]


def test_a_transfer_that_a_gap_in_the_capture_cuts_is_a_note() -> None:
    first, _, third = status(4).frames()
    dense = [at(LATE - 40 * MS + k * MS, throttle(9 + k).frames()[0]) for k in range(20)]
    for after, rule in ((2500 * MS, "TRF-007"), (1200 * MS, "TRF-003")):
        text = lines(
            usual(), PAUSE, dense, at(LATE, first), at(LATE + after, third), awake(LATE + after + MS, 2 * LATE)
        )
        assert [severity for severity, *_ in said(text, rule)] == ["note"]
    begun, next_ = [at(LATE, first)], [at(LATE + 1200 * MS + k, one) for k, one in enumerate(status(4, 7).frames())]
    assert [severity for severity, *_ in said(lines(usual(), PAUSE, dense, begun, next_), "TRF-006")] == ["note"]
    awake_ = awake(LATE + MS, LATE + 1200 * MS)
    assert [severity for severity, *_ in said(lines(usual(), PAUSE, dense, begun, awake_, next_), "TRF-006")] == [
        "error"
    ]
    soon = [at(LATE + 5 * MS + k, one) for k, one in enumerate(status(4, 7).frames())]
    assert [severity for severity, *_ in said(lines(usual(), PAUSE, dense, begun, soon, next_[:1]), "TRF-006")] == [
        "error"
    ]


def test_the_end_of_the_capture_cuts_a_transfer() -> None:
    text = lines(usual(), status(4).frames()[:2])
    assert said(text, "TRF-008") == [("note", 1, 13, "2 frames received when the capture ended")]
    assert said(lines(usual()), "TRF-008") == []


def test_another_transfer_id_inside() -> None:
    first, second, third = status(4).frames()
    text = lines(usual(), first, tail(second, 0x2C), third)
    assert said(text, "TRF-009") == [("error", 1, 14, "transfer ID 12 inside 4: it belongs to that one")]
    assert said(lines(usual()), "TRF-009") == []


def test_frames_that_are_not_full_or_empty() -> None:
    payload = status(4).frames()
    short = replace(payload[1], data=payload[1].data[2:])
    assert said(lines(usual(), payload[0], short, payload[2]), "TRF-012") == [
        ("error", 1, 13, "6 bytes in frame 14, which is not the last")
    ]
    bare = replace(payload[2], data=payload[2].data[-1:])
    text = lines(usual(), payload[0], payload[1], bare)
    assert said(text, "TRF-013") == [("note", 1, 13, "last frame 15 has only the tail byte")]
    assert said(text, "TRF-012") == said(lines(usual()), "TRF-013") == []
    room = replace(payload[0], data=payload[0].data[:2] + payload[0].data[-1:])
    assert said(lines(usual(), room, payload[1:]), "TRF-014") == [("error", 1, 13, "first frame of 3 bytes")]
    roomy = replace(payload[0], data=payload[0].data[:3] + payload[0].data[-1:])
    assert said(lines(usual(), roomy, payload[1:]), "TRF-014") == []


def test_two_transfers_take_turns() -> None:
    one, other = status(4).frames(), status(5).frames()
    text = lines(usual(), [frame for pair in zip(one, other, strict=True) for frame in pair])
    assert said(text, "TRF-026") == [("error", 2, 13, "transfer IDs 4 and 5 take turns")]
    between = [push(9).frames()[0], *one[1:]]
    assert said(lines(usual(), one[0], between), "TRF-026") == []


def test_pauses() -> None:
    first, second, third = status(4).frames()
    text = lines(usual(), at(LATE, first), second, at(LATE + 301 * MS, third))
    assert said(text, "TRF-027") == [("note", 1, 14, "300 ms between frames 14 and 15")]
    assert judge(text, ("TRF-027",), numbers={"TRF-027": {"pause_ms": 400}}) == []
    near = lines(usual(), at(LATE, first), second, at(LATE + 61 * MS, third))
    assert said(near, "TRF-027") == []
    (found,) = judge(near, ("TRF-027",), numbers={"TRF-027": {"pause_ms": 50}})
    assert found.text == "60 ms between frames 14 and 15"


@pytest.mark.slow
def test_captures_without_times() -> None:
    text = lines(usual(), status(4).frames()[1:], timed=False)
    assert said(text, "TRF-007") == said(text, "TRF-027") == []
    assert said(text, "TRF-005") == [("error", 1, 13, "transfer ID 4, first frame lost (of 3)")]


def test_what_is_left_of_a_damaged_transfer_is_not_called_needless() -> None:
    """Two frames hold 7 bytes because the first one came short; its CRC says that there were more."""
    first, *others = status(0).frames()
    short = replace(first, data=first.data[:3] + first.data[-1:])
    text = lines(short, others[-1])
    assert [one.rule for one in judge(text, ("TRF-015", "TRF-012"))] == ["TRF-012"]
