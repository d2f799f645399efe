"""The answer of triage, as tables and texts are made of it. Times are nanoseconds of the capture's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.odd.judge import OddEsc
    from analyzer.flight.odd.later import OddLater
    from analyzer.flight.timeline.timeline import TimeLine

Support = Literal["well supported", "likely", "possible"]
SUPPORTS: tuple[Support, Support, Support] = ("well supported", "likely", "possible")


_RECORDER = frozenset({"gap", "clock", "loss"})  # events that are none of the vehicle


@dataclass(frozen=True, slots=True)
class Verdict:
    """A cause of some kind (a page of `explain`), of whom, between `t` and `t_end`, and how well it is supported.

    `reasons` speak for it, `against` against it, each in one line; `notes` say more, with a label each.
    """

    kind: str
    title: str
    support: Support
    bus: int | None = None
    node: int | None = None
    ch: int | None = None
    chs: tuple[int, ...] = ()
    t: int | None = None
    t_end: int | None = None
    frame: int | None = None
    reasons: Sequence[str] = ()
    against: Sequence[str] = ()
    notes: Sequence[tuple[str, str]] = ()

    @property
    def told(self) -> bool:
        """True if it tells a cause."""
        return self.kind not in {"none", "unknown"}

    @property
    def gist(self) -> str:
        """The title without the device that it may begin with: `ESC ch4 (node 14): `."""
        who, colon, what = self.title.partition(": ")
        return what if colon and who.startswith(("ESC ", "node ")) else self.title


@dataclass(frozen=True, slots=True)
class Excluded:
    """A fact that was looked for, and what was seen instead."""

    fact: str
    seen: str


@dataclass(frozen=True, slots=True)
class Triage:
    """The triage of a capture: the verdicts on one flight, the first of them is what broke first.

    `judged` is why nothing could be judged, empty if it could, and `empty` that nothing of DroneCAN, or no time, is in
    it at all. `primary` are the events that began it, `after` consequences, `earlier` what was over before. `said` is
    what the autopilot's log says around it, `autopilot` how that log lies on the capture, None without one.

    `odds` finds the ESCs that are odd. `lines` speak of the clock and the recorder, with a label each, `not_seen` of
    what is not on the bus, `looked` of what was looked at, `commands` of what to do next. `timelines` are there to be
    drawn, if that was asked for.
    """

    captures: Sequence[str]
    buses: Sequence[str]
    start: int | None
    end: int | None
    frames: int
    flights: Sequence[Flight]
    flight: Flight | None
    verdicts: Sequence[Verdict]
    judged: str = ""
    empty: bool = False
    after: Sequence[FlightEvent] = ()
    earlier: Sequence[FlightEvent] = ()
    events: Sequence[FlightEvent] = ()
    more: int = 0
    excluded: Sequence[Excluded] = ()
    not_seen: Sequence[str] = ()
    looked: Sequence[str] = ()
    lines: Sequence[tuple[str, str]] = ()
    commands: Sequence[str] = ()
    primary: Sequence[FlightEvent] = ()
    said: Sequence[FlightEvent] = ()
    autopilot: Mapping[str, Any] | None = None
    timelines: Sequence[TimeLine] = field(default=(), compare=False)
    odds: OddLater | None = field(default=None, compare=False)

    @property
    def odd(self) -> Sequence[OddEsc]:
        """The ESCs that differ from their own past, or always from the others."""
        return () if self.odds is None else self.odds.report.odd

    @property
    def odd_before(self) -> Sequence[OddEsc]:
        """Those of them that did so before what is told here."""
        return () if self.odds is None else self.odds.before

    @property
    def facts(self) -> Sequence[str]:
        """Facts that whole groups of them have in common."""
        return () if self.odds is None else self.odds.report.facts

    @property
    def first(self) -> Verdict:
        """The verdict of the screen."""
        return self.verdicts[0]

    @property
    def well(self) -> bool:
        """True if a flight was judged, and nothing wrong was seen in it to its end."""
        return self.first.kind == "none" and not self.judged and not self.wrong

    def ending(self, flight: Flight) -> str:
        """Say how a flight ended: motors that stop are no landing where not all was well in the judged one."""
        judged = self.flight is not None and flight.number == self.flight.number
        return "motors stopped" if flight.end == "landed" and judged and not self.well else flight.end

    @property
    def wrong(self) -> bool:
        """True if something wrong was seen in a flight, whether or not anybody can tell its cause."""
        return self.first.told or bool(self.primary) or any(one.kind not in _RECORDER for one in self.after)
