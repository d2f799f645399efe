"""Transfers that come again after later ones: copies, not 30 lost ones; and what only looks like it."""

from __future__ import annotations

import pytest
from kit.judged import Said, whole
from kit.traffic import ALIVE, Timed, alive, log

IDS = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")


def count(*ids: int, other: int | None = None) -> list[Said]:
    """A NodeStatus every 100 ms behind one at the start, with its ID as status code (`other`: one has not)."""
    sent: list[Timed] = [(0, alive(9, 11, ids[0] - 1)), (2800, alive(98, 98)), (9000, alive(99, 98, 1))]
    sent += [
        (3000 + 100 * k, alive(9, 11, one, vendor_specific_status_code=77 if k == other else one))
        for k, one in enumerate(ids)
    ]
    return whole(log(*sent), IDS)


@pytest.mark.parametrize("ids", [(5, 6, 5, 7), (5, 6, 7, 5, 8), (31, 0, 1, 31, 2), (0, 1, 0, 2)])
def test_a_copy_of_an_earlier_transfer_is_one_and_nothing_is_missing(ids: tuple[int, ...]) -> None:
    (one,) = count(*ids, (ids[-1] + 1) % 32)
    again = len(ids) - 2
    before = ids.index(ids[again])
    assert (one.rule, one.severity, one.type, one.count) == ("TRF-017", "warning", ALIVE, 1)
    assert one.text == f"transfer ID {ids[again]} again after {100 * (again - before):.1f} ms, same payload"


def test_two_transfers_that_come_again_together_are_told_at_the_first() -> None:
    (one,) = count(5, 6, 7, 8, 5, 6, 9, 10)
    assert (one.rule, one.count, one.text) == ("TRF-017", 1, "transfer ID 5 again after 400.0 ms, same payload")


@pytest.mark.parametrize(
    ("ids", "other"),
    [((5, 6, 5, 7, 8), 2), ((5, 6, 5, 8, 9), None), ((5, 6, 5, 6, 7), None), ((5, *range(6, 15), 5, 15, 16), None)],
)
def test_what_has_another_payload_or_does_not_count_on_is_no_copy(ids: tuple[int, ...], other: int | None) -> None:
    assert {one.rule for one in count(*ids, other=other)} == {"TRF-016"}


def test_thirty_transfers_lost_again_and_again_are_no_copies() -> None:
    found = count(*(k * 31 % 32 for k in range(12)))
    assert "TRF-017" not in {one.rule for one in found}
