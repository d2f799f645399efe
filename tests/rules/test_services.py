"""Requests and responses: strays, silence, delay, repetitions and priorities."""

from __future__ import annotations

import pytest
from kit.encode import Transfer, transfer
from kit.judged import Said, judge, proved, registry, whole
from kit.simulated import flight
from kit.traffic import Timed, alive, log

from analyzer.decode.engine import Engine
from analyzer.rules import recent
from analyzer.rules.judge import Judge

RULES = ("TRF-021", "TRF-022", "TRF-023", "TRF-024", "TRF-025")
CALL = "uavcan.protocol.param.GetSet"
CLIENT, SERVER = 10, 11


def ask(transfer_id: int = 3, client: int = CLIENT, priority: int = 30) -> Transfer:
    fields = {"index": 0, "value": {"empty": {}}, "name": b"a"}
    return transfer(f"{CALL}.Request", fields, client, transfer_id, dst=SERVER, priority=priority)


def answer(transfer_id: int = 3, client: int = CLIENT, priority: int = 30) -> Transfer:
    empty: dict[str, object] = {"empty": {}}
    fields = {"value": empty, "default_value": empty, "max_value": empty, "min_value": empty, "name": b"abc"}
    return transfer(f"{CALL}.Response", fields, SERVER, transfer_id, dst=client, priority=priority)


def seen(*sent: Timed, end: int = 9000, without: tuple[int, ...] = ()) -> list[Said]:
    """What the rules find of transfers at times in ms, between heartbeats; `without` are lines that are lost."""
    beats = [(t, alive(t // 500, 99, t // 500)) for t in range(0, end + 1, 500)]
    rows = enumerate(log(*beats, *sent).splitlines(keepends=True), 1)
    return whole("".join(row for k, row in rows if k not in without), RULES)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 7])
@pytest.mark.parametrize("rule", RULES)
def test_a_simulated_fault_is_found_where_the_witness_finds_it(rule: str, seed: int) -> None:
    assert proved(rule, flight(f"{rule}@5", seconds=10, seed=seed), step=7)


def test_an_answered_request_breaks_nothing() -> None:
    assert seen((4010, ask()), (4020, answer())) == []


def test_the_only_response_of_a_server_counts_although_it_is_held_back_to_the_end() -> None:
    """One frame of a node that was never heard proves nothing, so the core lets it out at the end."""

    def single(kind: str, src: int, payload: bytes, transfer_id: int, dst: int) -> Transfer:
        return Transfer(kind, 5, src, payload, 0, transfer_id, dst, 30)

    magic = 0xACCE551B1E.to_bytes(5, "little")
    asked = [(2010 + 2000 * k, single("request", CLIENT, magic, k, SERVER)) for k in range(4)]
    server = [(t, alive(t // 1000, SERVER, t // 1000)) for t in range(9100, 20000, 1000)]
    reply = (8020, single("response", SERVER, b"\x80", 3, CLIENT))
    assert [(one.rule, one.count) for one in seen(*server, *asked, end=20000)] == [("TRF-022", 4)]
    assert [(one.rule, one.count) for one in seen(*server, *asked, reply, end=20000)] == [("TRF-022", 3)]


@pytest.mark.slow
def test_nothing_is_said_of_answers_that_a_gap_in_the_capture_or_a_loss_of_the_recorder_may_hide() -> None:
    asked, reply = (4010, ask()), (4020, answer())
    beats = [(t, alive(t // 500, 99, t // 500 % 32)) for t in range(0, 9001, 500)]
    (open_,) = whole(log(*beats, asked), RULES)
    assert (open_.rule, open_.severity) == ("TRF-022", "warning")
    dense = [(3900 + k, alive(k, 98, k)) for k in range(32)]
    pause = [(t + 6000 * (t > 4100), sent) for t, sent in [*beats, *dense, asked]]
    assert whole(log(*pause), RULES) == []
    (slow,) = whole(log(*((t + 6000 * (t > 4100), sent) for t, sent in [*beats, asked])), RULES)
    assert slow.rule == "TRF-022"  # where little is sent, a silence hides nothing
    (early,) = whole(log(*((t + 6000 * (t > 4015), sent) for t, sent in [*beats, reply])), RULES)
    assert (early.rule, early.severity) == ("TRF-021", "note")
    for sent, rule in ((asked, "TRF-022"), (reply, "TRF-021")):
        lines = log(*beats, sent).splitlines(keepends=True)
        lines.insert(11, "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n")
        (noted,) = whole("".join(lines), RULES)
        assert (noted.rule, noted.severity) == (rule, "note")


@pytest.mark.parametrize("stray", [answer(4), answer(3, client=12)])
def test_a_response_needs_a_request_of_its_nodes_and_id(stray: Transfer) -> None:
    (one,) = seen((4010, ask()), (4020, answer()), (4030, stray))
    assert (one.rule, one.severity, one.node) == ("TRF-021", "error", SERVER)


def test_a_request_that_comes_out_long_after_its_response_counts() -> None:
    """The client says nothing else, so its first request is held back until the second one."""
    server = [(t, alive(t // 1000, SERVER, t // 1000)) for t in range(100, 16000, 1000)]
    calls = [(4010, ask()), (4020, answer()), (15010, ask(4)), (15020, answer(4))]
    assert seen(*server, *calls, end=16000) == []
    (one,) = seen(*server, *calls, (8010, answer(5)), end=16000)
    assert (one.rule, one.text) == ("TRF-021", "no request with transfer ID 5 from node 10")


def test_a_stray_response_names_its_id_and_client() -> None:
    (one,) = seen((4010, answer(7)))
    assert (one.text, one.first) == ("no request with transfer ID 7 from node 10", 10)


def test_a_stray_response_early_in_the_capture_is_a_note() -> None:
    assert [one.severity for one in seen((1990, answer()))] == ["note"]


def test_a_request_is_too_old_after_two_seconds() -> None:
    assert {one.rule for one in seen((4010, ask()), (6010, answer()))} == {"TRF-022", "TRF-023"}
    assert {one.rule for one in seen((4010, ask()), (6011, answer()))} == {"TRF-022", "TRF-021"}


def test_a_silent_server_is_reported_once_the_second_is_over() -> None:
    (one,) = seen((4010, ask()))
    assert (one.rule, one.severity, one.node, one.first) == ("TRF-022", "warning", CLIENT, 10)
    assert one.text == "no answer of node 11 within 1.0 s"
    assert seen((4010, ask()), end=5000) == []


def test_lines_of_requests_that_wait_are_kept_though_nothing_but_frames_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Requests wait for a sign of their server while frames come for which the recent past has no room."""
    monkeypatch.setattr(recent, "KEPT", 1024)
    asked = log(*((t, alive(t // 500, 99, t // 500)) for t in range(0, 5000, 500)), (1100, ask()), (1200, ask(4)))
    begun = asked.splitlines()
    base = float(begun[-1].split()[0].strip("()"))
    others = [f"({base + k / 1000:.6f}) can0 14040A0C#{'AB' * 7}24" for k in range(1, 3000)]
    lines, running, judge_ = [*begun, *others], Engine(registry()), Judge(registry())
    for at in range(0, len(lines), 50):
        for batch in [*running.feed("".join(f"{one}\n" for one in lines[at : at + 50]).encode()), running.flush()]:
            judge_.feed(batch)
    (missed,) = [run for key, run in judge_.finish().runs if key.rule == "TRF-022"]
    shown = [line.split()[2] for one in missed.examples for line in one.lines]
    requests = [line.split()[2] for line in begun if line.split()[2][4:8] == f"8B{0x80 | CLIENT:02X}"]
    assert len(shown) == 2
    assert shown == [one for one in requests if one in shown]


def test_what_waits_takes_slots_that_others_have_left() -> None:
    server = [(t, alive(t // 500, SERVER, t // 500)) for t in range(250, 60000, 500)]
    calls = [(1000 + 100 * k, ask(k % 32)) for k in range(580)]
    replies = [(1010 + 100 * k, answer(k % 32)) for k in range(580) if k % 50 != 7]
    found = seen(*server, *calls, *replies, end=60000)
    assert [(one.rule, one.count) for one in found] == [("TRF-022", 12)]


def test_a_slow_answer_is_a_note() -> None:
    assert seen((4010, ask()), (4500, answer())) == []
    (one,) = seen((4010, ask()), (4710, answer()))
    assert (one.rule, one.severity, one.text[:16]) == ("TRF-023", "note", "answered after 0")


def test_a_second_answer_is_reported_with_the_first() -> None:
    (one,) = seen((4010, ask()), (4020, answer()), (4030, answer()))
    assert (one.rule, one.text) == ("TRF-024", "second response, transfer ID 3")


def test_an_answer_of_another_priority_is_a_note() -> None:
    (one,) = seen((4010, ask(priority=30)), (4020, answer(priority=16)))
    assert (one.rule, one.text) == ("TRF-025", "request 30, response 16")


def test_a_damaged_request_counts_for_its_response() -> None:
    fields = {"index": 0, "value": {"empty": {}}, "name": b"a" * 20}
    request = transfer(f"{CALL}.Request", fields, CLIENT, 3, dst=SERVER)
    assert len(request.frames()) == 4
    for lost in (11, 13):
        assert seen((4010, request), (4020, answer(priority=31)), without=(lost,)) == []


@pytest.mark.slow
def test_a_steady_flight_breaks_nothing() -> None:
    assert judge(flight(seconds=10), RULES) == []
