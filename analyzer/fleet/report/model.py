"""The report of a fleet as plain data. Rates are captures with such a finding per 100 flight hours."""

from __future__ import annotations

from typing import Any

from dissectors.records import as_dict, dataclass, field

SCHEMA = "tailbyte.fleet/1"


@dataclass(frozen=True, slots=True)
class FleetHead:
    """The size of a fleet. Duplicates, unreadable and unavailable captures are in no rate."""

    store: str
    captures: int
    judged: int
    not_judged: int
    damaged: int
    unreadable: int
    unavailable: int
    duplicates: int
    vehicles: int
    flights: int
    flight_hours: float
    first_day: str
    last_day: str
    settings: tuple[str, ...]
    versions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class OpenFirst:
    """A capture to look at, and the command for it."""

    vehicle: str
    date: str
    title: str
    kind: str
    support: str
    ch: int | None
    url: str
    command: str


@dataclass(frozen=True, slots=True)
class EscOutlier:
    """An ESC that is not as it was, or not as others with its firmware are.

    `difference` is to the other ESCs of its flights, `fleet` and `spread` what that is in the fleet; `share` tells that
    both are parts of the others' value, not kelvin. `since` is a day, empty if it was always so. `points` are days and
    differences.
    """

    vehicle: str
    ch: int | None
    node: int
    quantity: str
    what: str
    share: bool
    difference: float
    fleet: float
    spread: float
    flights: int
    since: str
    against: str
    support: str
    p: float
    points: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class SoftwareUse:
    """A firmware of ESCs, and how much it flew."""

    software: str
    flights: int
    hours: float
    vehicles: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RuleRate:
    """How often a rule is broken with a firmware, and whether that differs from the other firmware."""

    rule: str
    title: str
    software: str
    captures: int
    rate: float
    low: float
    high: float
    p: float
    differs: bool
    separable: bool
    only_on: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Worse:
    """A rule broken more often since a day."""

    rule: str
    title: str
    before: float
    after: float
    p: float


@dataclass(frozen=True, slots=True)
class SinceThen:
    """Rules that got worse since a day, and for each the growth that would have been seen: a factor, None for none.

    Compared are the `vehicles` that flew before and after it: what a new one brings is no change.
    """

    day: str
    hours_before: float
    hours_after: float
    worse: tuple[Worse, ...] = ()
    seen: dict[str, float | None] = field(default_factory=dict)
    vehicles: int = 0


@dataclass(frozen=True, slots=True)
class RuleCount:
    """How many captures and vehicles break a rule, and which vehicle does so most often."""

    rule: str
    title: str
    severity: str
    captures: int
    vehicles: int
    example: str
    most: str
    of_most: int

    @property
    def one_of_them(self) -> bool:
        """True if a single vehicle of several has most of it."""
        return self.vehicles > 1 and self.of_most > self.captures / 2


@dataclass(frozen=True, slots=True)
class VehicleCount:
    """How a vehicle does."""

    vehicle: str
    captures: int
    failed: int
    flights: int
    hours: float


@dataclass(frozen=True, slots=True)
class Unread:
    """A capture without a result."""

    url: str
    outcome: str
    error: str


@dataclass(frozen=True, slots=True)
class FleetReport:
    """All of it."""

    head: FleetHead
    open_first: tuple[OpenFirst, ...]
    odd: tuple[EscOutlier, ...]
    tested: int
    least_flights: int
    software: tuple[SoftwareUse, ...]
    rates: tuple[RuleRate, ...]
    since: SinceThen | None
    rules: tuple[RuleCount, ...]
    vehicles: tuple[VehicleCount, ...]
    unread: tuple[Unread, ...]

    def as_json(self) -> dict[str, Any]:
        """Return plain dictionaries and lists, `schema` first."""
        plain: dict[str, Any] = as_dict(self)
        return {"schema": SCHEMA, **plain}
