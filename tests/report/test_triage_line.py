"""What triage says stands in the head of every report, in its colour, and changes no verdict and no exit status."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.reports import START, capture, healthy

from analyzer.report import github, headline, markdown, text
from analyzer.report.model import Report, TriageSummary
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

LOST = TriageSummary(
    "propulsion", "ESC ch5 (node 24): lost the load of its motor", "well supported", "can0", 24, 5, START,
    START + 61 * SECOND, 4711, 3, 3, "cut", True,
)  # fmt: skip
CALM = replace(LOST, kind="none", title="nothing wrong seen on this bus", support="", end="landed", wrong=False)
DARK = replace(CALM, kind="unknown", title="cannot tell: the recording ends in flight", flight=1, flights=1, end="cut")


LOST_CONTROL = replace(
    DARK, title="cannot tell: control was lost, and ch4 reports nothing any more", end="landed", wrong=True
)
STOOD = replace(CALM, title="nothing wrong seen on this bus until several rotors stood at once", wrong=True)


def with_(happened: TriageSummary | None, **more: object) -> Report:
    return replace(healthy(), captures=(capture(triage=happened, **more),))


@pytest.mark.parametrize(
    "render", [text.render, markdown.render, github.commands], ids=["text", "markdown", "github"]
)  # fmt: skip
def test_a_cause_is_in_the_head(render: Callable[[Report], str]) -> None:
    shown = " ".join(render(with_(LOST)).split())
    assert "Triage: " in shown
    assert "ESC ch5 (node 24): lost the load of its motor (well supported) at " in shown
    assert "flight 3 of 3, cut" in shown


def test_a_cause_is_no_green_pass_and_no_failure() -> None:
    head = headline.of(with_(LOST))
    assert (head.verdict, head.tone) == ("PASS", "caution")
    assert with_(LOST).gate.exit_status == 0
    assert headline.of(with_(CALM)).tone == headline.of(with_(None)).tone == "good"
    assert headline.of(with_(DARK)).tone == "good"


@pytest.mark.parametrize("happened", [LOST_CONTROL, STOOD], ids=["unknown", "none"])
def test_what_went_wrong_is_no_green_pass_and_no_landing_though_nobody_knows_why(happened: TriageSummary) -> None:
    head = headline.of(with_(happened))
    assert (head.verdict, head.tone) == ("PASS", "caution")
    assert head.happened[0].text.endswith("motors stopped")
    assert head.happened[0].command


def test_what_was_seen_has_a_command_unless_nothing_was_wrong() -> None:
    commands = [headline.of(with_(one)).happened[0].command for one in (LOST, DARK, CALM)]
    assert commands == ["tailbyte triage crash.log", "tailbyte triage crash.log", ""]
    more = with_(LOST, path="my log.log", arguments=("--same-bus", "other.log"))
    assert headline.of(more).happened[0].command == "tailbyte triage 'my log.log' --same-bus other.log"
    assert headline.of(with_(LOST, form="")).happened[0].command == ""  # a bus that nobody recorded


def test_no_flight_no_line() -> None:
    assert headline.of(with_(None)).happened == ()
    assert "Triage" not in text.render(with_(None))


def test_text_of_a_capture_is_escaped() -> None:
    evil = replace(LOST, title="ch5 \x1b[2J::error title=x::\nhello")
    for render in (text.render, markdown.render, github.commands):
        shown = render(with_(evil))
        assert "\x1b" not in shown
        assert "\nhello" not in shown
