"""The view of the browser on whoever decodes and judges: it asks, and knows neither files nor buses."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import TableStore
    from analyzer.filter.memory import NamesFrames
    from dissectors import Registry

TABS = ("packets", "findings", "events", "flights", "triage", "statistics", "notes")
ONLY_ONCE = "what comes from a bus or a pipe exists only once"


class TabLine(NamedTuple):
    """A line of a tab: where it leads to, a frame from 0 or a time in nanoseconds, and the filter it stands for.

    `ask` is a statistic that it asks for.
    """

    text: str
    style: str = ""
    frame: int | None = None
    t: int | None = None
    filter: str = ""
    ask: str = ""


class Supply(Protocol):
    """Decodes into a store, judges, and finds out what the tabs show; everything is None until it is known.

    Attributes:
        store: the batches that are decoded.
        registry: the types.
        name: of the captures or buses.
        paths: captures as the commands take them, empty for a bus.
        arguments: what else a command needs to read them in the same way.
        window: arguments that name the part of them that is shown.
        recorded: the file that a bus is recorded in as a whole, empty without one.
        live: they come from a bus.
        doing: what is done now, in a word or two, empty for nothing.
        notes: what was complained of.
        flights: first and last time of each.
        places: what is to be read at frames, from 0: events, and where flights begin and end.
        troubles: time and severity of each finding.
        starts: frames at which findings begin, from 0, ascending.
        labels: of nodes in the vehicle file.
        severities: of rules.
        remarks: comments of the captures themselves, on frames, from 0.
        asking: a statistic is asked for that is not there yet.
    """

    store: TableStore
    registry: Registry
    name: str
    paths: tuple[str, ...]
    arguments: tuple[str, ...]
    window: tuple[str, ...]
    recorded: str
    live: bool
    doing: str
    notes: list[str]
    flights: Sequence[tuple[int, int]]
    places: dict[int, str]
    troubles: Sequence[tuple[int, str]]
    starts: Sequence[int]
    labels: dict[int, str]
    asking: bool
    severities: dict[str, str]
    remarks: dict[int, str]

    @property
    def revision(self) -> int:
        """Return a number that rises with each finding that may name rows which are there already."""

    @property
    def named(self) -> NamesFrames | None:
        """The rules that name frames."""

    @property
    def loaded(self) -> bool:
        """True once no batch comes any more."""

    @property
    def share(self) -> float:
        """How much of the captures is decoded, from 0 to 1."""

    def tab(self, name: str) -> Sequence[TabLine] | None:
        """Return what a tab shows, one of `TABS`."""

    def changed(self) -> str:
        """Return what has become of the files since they were read, once; empty for nothing."""

    def only_once(self) -> str:
        """Return why it cannot be read anew, empty if it can."""

    def renew(self, name: str) -> None:
        """Find out anew what a tab shows, where that may have changed since."""

    def ask(self, text: str) -> str:
        """Ask for a statistic, which is in its tab later; return what is wrong with it, empty for nothing."""

    def explain(self, rule: str, width: int) -> str:
        """Return the page of a rule, empty if there is none or it is not known yet."""

    def stop(self) -> None:
        """Ask for the end."""
