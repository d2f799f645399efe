"""The monitor makes room for the browser, and comes back."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import analyzer.terminal
from analyzer.app.criteria import Criteria
from analyzer.app.live.monitor import Display
from analyzer.app.request import RuleChoice
from dissectors import load

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pytest


class Inner:
    ended = False

    def __init__(self, shows: Callable[[], None]) -> None:
        self.run = shows


def display(monkeypatch: pytest.MonkeyPatch, shows: Callable[[Display], None]) -> tuple[Display, list[str]]:
    """Return a display whose monitor asks for the browser once, and what happens."""
    happened: list[str] = []
    inner: list[Inner] = []

    @contextmanager
    def browser() -> Iterator[Inner]:
        happened.append("begins")
        inner.append(Inner(lambda: shows(made)))
        yield inner[0]
        happened.append(f"ends {inner[0].ended}")

    def monitor(feed: Display) -> None:
        happened.append("monitor")
        if happened.count("monitor") == 1:
            feed.browse()

    monkeypatch.setattr(analyzer.terminal, "run", monitor)
    made = Display(Criteria(RuleChoice(), load()), {}, lambda: None, lambda _: "", lambda: None, browser)
    return made, happened


def test_the_browser_comes_between_two_monitors(monkeypatch: pytest.MonkeyPatch) -> None:
    made, happened = display(monkeypatch, lambda _: None)
    made.run()
    assert happened == ["monitor", "begins", "ends False", "monitor"]


def test_the_browser_hears_that_the_session_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    made, happened = display(monkeypatch, lambda one: setattr(one, "ended", True))
    made.run()
    assert happened == ["monitor", "begins", "ends True", "monitor"]
    assert made.ended


def test_a_browser_that_fails_leads_back(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: Display) -> None:
        raise OSError("no room")

    made, happened = display(monkeypatch, fails)
    made.run()
    assert happened == ["monitor", "begins", "monitor"]
    assert not made.failed
