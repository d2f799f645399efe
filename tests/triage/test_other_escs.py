"""ESCs that tell speed and supply in two messages, and no number, are held against their past, too."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES
from kit.other_esc import other_esc_log
from kit.stories import said, triaged, without

import analyzer
from analyzer.flight.finder import EventFinder

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

CHANNEL_TOLD = 20013


def test_a_lost_propeller() -> None:
    found = triaged(other_esc_log("propeller-lost:tail=no:twin=no", seed=12, rate=50))
    assert (found.first.kind, found.first.node, found.first.ch) == ("propulsion", 14, 4)
    assert "speed +26 %, current -82 % at such a command: its load is gone" in said(found)
    assert "fault bits: not told by these ESCs" in said(found)


@pytest.mark.slow
def test_a_motor_that_stands() -> None:
    found = triaged(other_esc_log("motor-stall:tail=no:twin=no", escs=6, rate=50))
    assert (found.first.kind, found.first.ch) == ("esc", 6)
    assert "it stands" in said(found)


@pytest.mark.slow
def test_one_that_limits_itself_says_so_by_its_heat_alone() -> None:
    found = triaged(other_esc_log("derating:tail=no:twin=no", seed=24, rate=50))
    assert (found.first.kind, found.first.ch, found.first.support) == ("esc", 4, "possible")
    assert "limits itself" in found.first.title
    assert "hotter than the others" in said(found)


@pytest.mark.slow
def test_a_landing_is_none() -> None:
    found = triaged(other_esc_log("landing"))
    assert (found.first.kind, found.flights[-1].end) == ("none", "landed")
    assert not any(one.kind == "motor" for one in found.events)


def test_without_a_channel_nobody_knows_what_it_was_commanded() -> None:
    text = other_esc_log("propeller-lost:tail=no:twin=no", seed=12, rate=50)
    found = triaged(without(text, lambda _, type_id, __: type_id == CHANNEL_TOLD))
    assert not any(one.kind == "motor" for one in found.events)


def test_the_hot_one_of_the_sample_is_told() -> None:
    found = analyzer.triage(CAPTURES / "hobbywing.log")
    assert (found.first.kind, found.first.ch, found.first.support) == ("esc", 3, "possible")
    assert "limits itself: it gives less than is commanded" in found.first.title
    assert "138 C at most" in said(found)


def test_halves_that_come_in_other_batches_are_the_same(decode: Callable[..., Any], registry: Registry) -> None:
    text = other_esc_log("propeller-lost:tail=no:twin=no", seed=12, rate=50).encode()

    def told(*chunks: bytes) -> list[dict[str, Any]]:
        finder = EventFinder(registry)
        for batch in decode(*chunks).batches:
            finder.feed(batch)
        return list(finder.finish().to_pylist())

    whole = told(text)
    assert any(one["kind"] == "motor" for one in whole)
    assert told(*(text[at : at + 20_011] for at in range(0, len(text), 20_011))) == whole
