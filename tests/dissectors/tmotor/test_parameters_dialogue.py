"""What becomes of ParamCfg."""

from __future__ import annotations

import pytest
from kit import VECTORS
from kit.flight import Vehicle, found
from kit.judged import judge, whole


def asked(*fields: dict[str, int], answer: float | None = None, **got: int) -> Vehicle:
    """One ParamCfg or more at 1 s, 5 ms apart, an answer, and reports until 4 s."""
    vehicle = Vehicle()
    for k, one in enumerate(fields):
        vehicle.configure(1000 + 5 * k, **one)
    if answer is not None:
        vehicle.parameters(1000 + answer, **got)
    vehicle.statuses(0, 4000)
    return vehicle


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "text"),
    [
        ({"esc_index": 0}, "index 0"),
        ({"esc_uuid": 0xA0}, "uuid 000000A0"),
        ({"esc_uuid": 0xA0, "esc_index": 7}, "uuid 000000A0"),
        ({"esc_timing": 20}, "any ESC"),
    ],
)
def test_no_answer(address: dict[str, int], text: str) -> None:
    vehicle = asked(address)
    (one,) = found(vehicle, "BUS-011")
    assert (one.node, one.text) == (126, f"no ParamGet of {text} within 1.0 s")
    assert one.frames == (next(s for s in vehicle.sent if s.name == "ParamCfg").frames[0],)
    assert len(found(asked(address, answer=1100), "BUS-011")) == 1
    assert found(asked(address, answer=900, esc_timing=20), "BUS-011") == []


@pytest.mark.slow
def test_the_answer_of_another_esc() -> None:
    assert len(found(asked({"esc_index": 0}, answer=50, esc_index=1), "BUS-011")) == 1
    assert len(found(asked({"esc_uuid": 0xA0}, answer=50, esc_uuid=0xA1), "BUS-011")) == 1
    assert found(asked({"esc_index": 0, "esc_id_set": 3}, answer=50, esc_index=3), "BUS-011") == []


def test_a_capture_that_ends_too_early() -> None:
    vehicle = Vehicle()
    vehicle.configure(1000, esc_index=0)
    vehicle.statuses(0, 1900)
    assert found(vehicle, "BUS-011") == []


def test_the_vector_without_an_answer() -> None:
    lines = (VECTORS / "violations.log").read_text().splitlines(keepends=True)[72:83]
    said = judge("".join(lines), ("BUS-011", "BUS-012", "BUS-013", "BUS-014", "BUS-015"))
    assert [(one.rule, one.frames) for one in said] == [("BUS-011", (4,))]


@pytest.mark.slow
def test_a_query_to_all() -> None:
    vehicle = Vehicle()
    for node in (11, 12, 13):
        vehicle.statuses(node, 4000, node)
    vehicle.statuses(0, 500, 14, mode=4)  # silent when it comes to the query
    vehicle.statuses(1, 4000, 15, mode=0)  # stock
    sent = vehicle.configure(3700 - 100)
    vehicle.parameters(3650, 11)
    vehicle.parameters(3700, 13)
    vehicle.statuses(4000, 5000, 11)
    (one,) = found(vehicle, "BUS-012")
    assert (one.node, one.frames) == (12, (sent.frames[0],))
    assert one.text == "no ParamGet of node 12 within 1.0 s"


@pytest.mark.slow
def test_a_setting_that_is_not_taken_over() -> None:
    vehicle = asked({"esc_index": 0, "esc_timing": 25, "esc_led_mode": 2}, answer=50, esc_timing=15)
    (one,) = found(vehicle, "BUS-013")
    assert (one.node, one.text) == (11, "esc_timing set to 25, reported as 15")
    assert found(asked({"esc_index": 0, "esc_timing": 25}, answer=50, esc_timing=25), "BUS-013") == []


@pytest.mark.slow
def test_settings_that_are_not_compared() -> None:
    assert found(asked({"esc_index": 0, "esc_acc_threshold": 0xFF}, answer=50), "BUS-013") == []
    assert found(asked({"esc_index": 0, "esc_id_set": 4}, answer=50, esc_id_req=4), "BUS-013") == []
    assert found(asked({"esc_index": 0, "esc_id_set": 4}, answer=50, esc_index=4), "BUS-013") == []
    (one,) = found(asked({"esc_index": 0, "esc_id_set": 4}, answer=50, esc_id_req=2), "BUS-013")
    assert one.text == "esc_id_set set to 4, reported as 2"


def test_a_setting_that_the_next_one_changes_again() -> None:
    twice = {"esc_index": 0, "esc_timing": 10}, {"esc_index": 0, "esc_timing": 12}
    assert found(asked(*twice, answer=50, esc_timing=12), "BUS-013") == []


@pytest.mark.slow
def test_parameters_that_nobody_asked_for() -> None:
    for at, count in ((2100, 1), (1900, 0), (900, 0)):
        vehicle = Vehicle()
        if at > 1000:
            vehicle.configure(1000, esc_index=0)
        sent = vehicle.parameters(at)
        vehicle.statuses(0, 3000)
        said = found(vehicle, "BUS-014")
        assert [(one.node, one.frames) for one in said] == [(11, (sent.frames[0],))] * count


@pytest.mark.slow
def test_a_uuid_that_no_esc_has() -> None:
    for told, count in ((True, 1), (False, 0)):
        vehicle = Vehicle()
        vehicle.parameters(100, 11)
        if told:
            vehicle.parameters(200, 12)
        vehicle.configure(1000, esc_uuid=1, esc_index=0)
        for node in (11, 12):
            vehicle.statuses(node, 4000, node)
        said = found(vehicle, "BUS-015")
        assert [one.text for one in said] == ["uuid 00000001, index 0: no ESC has this uuid"] * count


@pytest.mark.slow
def test_uuid_and_index_of_two_escs() -> None:
    for index, count in ((1, 1), (0, 0), (0xFF, 0)):
        vehicle = Vehicle()
        for node in (11, 12):
            vehicle.parameters(node * 10, node)
            vehicle.statuses(node, 4000, node)
        vehicle.configure(1000, esc_uuid=0xA0, esc_index=index)
        said = found(vehicle, "BUS-015")
        assert [one.text for one in said] == ["uuid 000000A0, index 1: that index has uuid 000000A1"] * count


def lines_of(vehicle: Vehicle) -> list[str]:
    return vehicle.finish().splitlines(keepends=True)


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["BUS-011", "BUS-012"])
def test_a_damaged_answer_is_one(rule: str) -> None:
    """It has a finding of its own, whether its CRC is wrong or a frame of it is missing."""
    vehicle = asked({"esc_index": 0} if rule == "BUS-011" else {}, answer=300)
    lines = lines_of(vehicle)
    frames = next(sent for sent in vehicle.sent if sent.name == "ParamGet").frames
    assert whole("".join(lines), (rule,), (7,)) == []
    head, _, data = lines[frames[1] - 1].partition("#")
    for text in (f"{head}#{int(data[0], 16) ^ 1:X}{data[1:]}", ""):
        assert whole("".join([*lines[: frames[1] - 1], text, *lines[frames[1] :]]), (rule,), (7,)) == []
    gone = "".join(line for k, line in enumerate(lines, 1) if k not in frames)
    assert len(whole(gone, (rule,), (7,))) == 1


@pytest.mark.slow
def test_an_answer_may_have_come_in_a_gap_of_the_capture() -> None:
    lines = lines_of(asked({"esc_index": 0}))
    start = float(lines[0][1:].split(")")[0])
    assert len(whole("".join(lines), ("BUS-011",), (7,))) == 1

    def moved(line: str) -> str:
        seconds, rest = line[1:].split(")", 1)
        return f"({float(seconds) + 1.5 * (float(seconds) > start + 1.2):.6f}){rest}"

    assert whole("".join(map(moved, lines)), ("BUS-011",), (7,)) == []


@pytest.mark.sampled(4)
@pytest.mark.parametrize("address", [{"esc_index": 1}, {"esc_uuid": 0xA1}])
@pytest.mark.parametrize(("last", "count"), [(8000, 1), (1500, 0)])
def test_the_addressee_has_to_live(address: dict[str, int], last: int, count: int) -> None:
    """Another ESC reports all the time and answers a query to all, which is no answer to what is meant for this one."""
    vehicle = Vehicle()
    vehicle.statuses(0, 8000, 11)
    vehicle.statuses(1, last, 12, esc_index=1)
    vehicle.configure(500)
    for node in (11, 12):
        vehicle.parameters(550 + node, node)
    vehicle.configure(5500, esc_timing=12, **address)
    vehicle.parameters(5600, 11)
    said = whole(vehicle.finish(), ("BUS-011",), (7,))
    assert [one.key.partition("=")[0] for one in said] == ["address"] * count


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("node", "count"), [(11, 1), (12, 0), (13, 0)])
def test_an_answer_that_cannot_be_read(node: int, count: int) -> None:
    """It counts unless its sender is known as another ESC."""
    vehicle = Vehicle()
    for index in range(2):
        vehicle.statuses(index, 6000, 11 + index, esc_index=index)
    vehicle.configure(500)
    for one in (11, 12, 13):
        vehicle.parameters(550 + one, one)
    vehicle.configure(2000, esc_index=1, esc_timing=12)
    sent = vehicle.parameters(2100, node)
    lines = vehicle.finish().splitlines(keepends=True)
    del lines[sent.frames[3] - 1]
    assert len(whole("".join(lines), ("BUS-011",), (7,))) == count
