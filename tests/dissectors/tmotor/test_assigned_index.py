"""BUS-039: an ID that an ESC confirmed, and the index that it reports with."""

from __future__ import annotations

import pytest
from kit import encode
from kit.judged import judge, said
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture

RULE = "BUS-039"
STEPS = pytest.mark.parametrize("step", [None, 1, 7])
UUID = 0xA1B2C3D4
OPEN = {
    field.partition(":")[0]: -1 if ":i" in field else (1 << int(field.partition(":u")[2])) - 1
    for field in encode.TYPES["ParamCfg"].layout.split()
}
NAMES = [field.partition(":")[0] for field in encode.TYPES["ParamGet"].layout.split()]


def give(at: float, index: int, **more: int) -> Planned:
    return at, 126, "ParamCfg", OPEN | {"esc_index": 1, "esc_uuid": UUID, "esc_id_set": index} | more


def confirm(at: float, index: int, node: int = 12, now: int = 1, uuid: int = UUID) -> Planned:
    return at, node, "ParamGet", dict.fromkeys(NAMES, 0) | {
        "esc_index": now, "esc_uuid": uuid, "esc_id_req": index, "rsvd": [],
    }  # fmt: skip


def reports(index: int, start: int, stop: int, node: int = 12) -> list[Planned]:
    return [(float(at), node, "ESCStatus", TURNING | {"esc_index": index}) for at in range(start, stop, 100)]


def texts(*sent: Planned, step: int | None = None) -> list[str]:
    return [one.text for one in said(RULE, capture(sorted(sent, key=lambda one: one[0])), step)]


@STEPS
def test_an_esc_that_goes_on_with_its_old_index(step: int | None) -> None:
    before = reports(1, 0, 1000)
    found = texts(*before, give(1000, 3), confirm(1010, 3), *reports(1, 1020, 6000), step=step)
    assert found == ["ID 3 confirmed, reports have index 1 more than 2 s later"]
    again = give(4020, 5), confirm(4030, 5)
    found = texts(*before, give(1000, 3), confirm(1010, 3), *reports(1, 1020, 9000), *again, step=step)
    assert found == [
        "ID 3 confirmed, reports have index 1 more than 2 s later",
        "ID 5 confirmed, reports have index 1 more than 2 s later",
    ]


@STEPS
def test_an_esc_that_confirms_twice(step: int | None) -> None:
    """All are asked 0.9 s later: that is no new promise."""
    sent = [give(1000, 3), confirm(1010, 3), confirm(1900, 3), *reports(1, 1020, 3400)]
    assert texts(*sent, step=step) == ["ID 3 confirmed, reports have index 1 more than 2 s later"]


@STEPS
@pytest.mark.parametrize(
    "sent",
    [
        [give(1000, 3), confirm(1010, 3), *reports(1, 1020, 2900), *reports(3, 2900, 6000)],  # it takes a while
        [give(1000, 3), confirm(1010, 3), *reports(1, 1020, 3200)],  # nobody knows yet
        [give(1000, 3), confirm(2100, 3), *reports(1, 2110, 9000)],  # too late for an answer
        [give(1000, 3), confirm(1010, 1), *reports(1, 1020, 9000)],  # refused: BUS-013
        [give(1000, 3), confirm(1010, 3, uuid=7), *reports(1, 1020, 9000)],  # of another ESC
        [give(1000, 0xFFFF), confirm(1010, 1), *reports(1, 1020, 9000)],  # none was given
        [give(1000, 0xFF), confirm(1010, 0xFF), *reports(1, 1020, 9000)],
        [give(1000, 1), confirm(1010, 1), *reports(1, 1020, 9000)],  # it has it already
        [give(1000, 3), confirm(1010, 3), *reports(1, 1020, 9000, node=13)],
        [*reports(1, 1020, 9000)],
    ],
)
def test_what_is_right_or_cannot_be_known(sent: list[Planned], step: int | None) -> None:
    assert texts(*sent, step=step) == []


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "startup", "bench"])
def test_a_simulated_esc_that_does_not_use_its_id(plan: str) -> None:
    found = judge(flight("BUS-039@5:node=12", flight=plan, seconds=9), (RULE,))
    assert [(one.node, one.count, one.text) for one in found] == [
        (12, 1, "ID 4 confirmed, reports have index 1 more than 2 s later")
    ]


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "startup", "bench"])
def test_a_clean_flight_has_none(plan: str) -> None:
    assert judge(flight(flight=plan, seconds=12), (RULE,)) == []
