"""The headline counts lines of the report, and names all that they are about."""

from __future__ import annotations

import pytest
from kit import reports

from analyzer.report import headline


@pytest.mark.parametrize(
    ("nodes", "told"),
    [
        ([20], "1 device error (ch1)"),
        ([20, 22], "2 device errors (ch1, ch3)"),
        ([20, 22, 24], "1 device error (ch1, ch3, ch5)"),
        ([20, 22, 24, 26], "1 device error (ch1, ch3, ch5, ...)"),
        ([None], "1 device error"),
    ],
)
def test_errors_are_named_by_all_their_places(nodes: list[int | None], told: str) -> None:
    """Three and more nodes with one error are one line: only the first of them was named once."""
    found = [reports.finding("TYP-306", node=node) for node in nodes]
    assert headline.of(reports.report(*found)).summary == told


def test_a_place_is_named_once() -> None:
    found = [reports.finding("TYP-306", node=node, label=label) for node, label in ((20, "ch1"), (21, ""), (22, ""))]
    late = reports.finding("TYP-306", node=21, label="", key="another")
    assert headline.of(reports.report(*found, late)).summary == "2 device errors (ch1, node 21, node 22)"


def test_a_place_may_be_called_anything() -> None:
    assert headline.of(reports.report(reports.finding("TYP-306", label="\x1b[2J"))).summary == (
        r"1 device error (\x1b[2J)"
    )


def test_it_has_the_lines_of_the_report() -> None:
    waived = headline.of(reports.waived())
    assert [one.head.rule for one in waived.problems if not one.open] == ["TRF-003"]
    assert (waived.verdict, waived.tone, waived.ungated) == ("NOT JUDGED", "idle", "")
