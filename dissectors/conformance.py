"""The vocabulary of conformance rules: what a rule sees of a capture, and how it says what it found.

A dissector's folder may hold rules that join its own tables; `analyzer.rules` runs them beside those that hold for any
bus. Both sides speak in the terms below, so that neither imports the other. Times are integer nanoseconds, frames and
transfers are numbered through the whole capture from 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, runtime_checkable

from dissectors.rows import MILLISECOND, NO_TIME, SECOND, Events, Frames, Kept, Table, Transfers, Words

if TYPE_CHECKING:
    from dissectors.schema import Message

__all__ = [
    "MILLISECOND", "NO_TIME", "SECOND", "Conformance", "Events", "Exercise", "Found", "Frames", "Kept", "Look",
    "Measures", "Occurrence", "Severity", "Table", "Transfers", "Types", "Values", "View", "Watcher", "Words",
    "watches",
]  # fmt: skip

Values = Mapping[str, Any]
Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One breach of a rule. `frames` are its evidence, the first one is its place; none for a silence.

    `type` is the name of a table. `values` fill the text of the rule's page and make up its key. `severity` stands
    instead of the page's. `dialects` maps the reading that the node turns out to use to another severity, or to None
    if it is no breach then. `drops` makes it a note close to frames that the recorder lost; it is looked for them from
    `since` to `until`, if these are not `t`. `lines` are the evidence as `View.lines` gave it, for a rule that holds an
    occurrence back.
    """

    rule: str
    t: int
    bus: int
    node: int | None
    type: str
    frames: Sequence[int]
    values: Values
    severity: Severity | None = None
    dialects: Mapping[str, Severity | None] = field(default_factory=dict)
    drops: bool = False
    since: int | None = None
    until: int | None = None
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Found:
    """Many breaches of one rule, a row each; what is equal for all is said once, as with `Occurrence`.

    `t`, `bus`, `node` (-1 for none), `frame` (-1 for none) and `type` (codes of `View.type_name`) are arrays of equal
    length. `key` tells rows apart whose values may give different keys. `values` and `frames` are asked for the few
    rows that are shown.
    """

    rule: str
    t: Words
    bus: Words
    node: Words
    type: Words
    frame: Words
    values: Callable[[int], Values]
    frames: Callable[[int], Sequence[int]]
    key: Words | None = None
    severity: Severity | None = None
    dialects: Mapping[str, Severity | None] = field(default_factory=dict)
    drops: bool = False
    since: Words | None = None


class Types(Protocol):
    """What the definitions say of a type; `code` is that of a transfer."""

    def signatures(self, code: int) -> Sequence[int]:
        """Those of the known types with this ID, the preferred one first; none for an unknown type."""

    def mistaken(self, code: int) -> Mapping[int, str]:
        """Signatures that a sender may take by mistake, each with the type name that gives it."""

    def undefined(self, code: int) -> Mapping[int, str]:
        """Signatures of further types with this ID, which are known by name only."""

    def fixed_bytes(self, code: int) -> int | None:
        """Payload bytes of a type whose transfers all have the same length."""

    def starting_from(self, crc_start: int) -> Sequence[str]:
        """Full names of the types whose transfer CRCs start from this value."""


class View(Protocol):
    """What a rule sees: one batch, what is known of the capture so far, and the settings."""

    @property
    def frames(self) -> Frames:
        """The frames of this batch."""

    @property
    def transfers(self) -> Transfers:
        """The transfers that ended in this batch."""

    @property
    def events(self) -> Events:
        """What else the capture has here."""

    @property
    def settled(self) -> Sequence[tuple[int, int, int]]:
        """Frames of earlier batches: number, final verdict, anomaly bits to add."""

    @property
    def buses(self) -> Sequence[str]:
        """Interface names by index."""

    @property
    def start(self) -> int:
        """The first time of any frame so far, `NO_TIME` without times."""

    @property
    def end(self) -> int:
        """The last time of any frame so far, `NO_TIME` without times."""

    @property
    def before(self) -> int:
        """The time of the last frame before this batch that has one, else `NO_TIME`."""

    @property
    def starts(self) -> Mapping[int, int]:
        """The first time by bus."""

    def resumed(self, t: int) -> int:
        """Since when frames have come without a gap in the capture (CAP-002), up to a time of this or the last batches.

        Nothing is known of what was sent in a gap, so nothing in front of it counts behind it. `NO_TIME` without times.
        """

    def paused(self, since: int, until: int) -> bool:
        """Whether the capture has a gap somewhere between two times (CAP-002) that may hide what is missing.

        It does where frames came close together before it; a bus with little traffic is silent that long at any time.
        """

    @property
    def resolution(self) -> int:
        """The power of ten of nanoseconds that all times so far are multiples of, from the first one on."""

    @property
    def bit_rate(self) -> int | None:
        """Bits per second, if known."""

    def table(self, name: str) -> Table | None:
        """The rows of a message (`ESCStatus`) or packet (`PUSHCAN.MotorStatus`) in this batch, None without any."""

    def tables(self) -> Iterable[str]:
        """Names of the tables that this batch has."""

    def definition(self, name: str) -> Message | None:
        """The type of a message table, None for other tables."""

    def number(self, rule: str, name: str) -> float:
        """A setting of a rule."""

    def type_name(self, code: int) -> str:
        """The name of a table by the code of a transfer's type; unknown types are named by their ID."""

    def type_of(self, code: int) -> Message | None:
        """What is known of a transfer's type by its code, None if it has no definition."""

    @property
    def types(self) -> Types:
        """What the definitions say."""

    def frame(self, number: int) -> Kept | None:
        """A frame of the recent past, None if it is gone."""

    def lines(self, frames: Iterable[int]) -> tuple[str, ...]:
        """Frames of the recent past as candump writes them, the first 16."""

    def choice(self, message: str, reading: str, bus: int, node: int) -> str:
        """What a node's doubtful field has shown up to this batch; depends on how the capture is cut into batches."""

    def among_transfers(self, rule: str, rows: Words, values: Callable[[int], Values], **about: Any) -> Found:
        """`Found` for transfers of this batch: `values` is asked with a row of the batch; `about` as `Found` has it."""

    def among_frames(self, rule: str, rows: Words, values: Callable[[int], Values], **about: Any) -> Found:
        """`Found` for frames of this batch, likewise; node and type are those of the identifier if it is DroneCAN's."""

    def among_rows(self, rule: str, table: Table, rows: Words, values: Callable[[int], Values], **about: Any) -> Found:
        """`Found` for rows of a message or packet table, likewise."""


class Watcher:
    """Follows a capture for the rules that it names; one object a capture, so it may remember what it needs.

    What it finds must not depend on where batches end. Memory is bounded.
    """

    rules: ClassVar[tuple[str, ...]] = ()

    def look(self, _view: View) -> Iterable[Found | Occurrence]:
        """Breaches that this batch shows."""
        return ()

    def settle(self, _view: View) -> Iterable[Found | Occurrence]:
        """Breaches that only the end of the capture shows; the view has no rows."""
        return ()


Look = Callable[[View], Iterable[Found | Occurrence]]


def watches(*rules: str) -> Callable[[Look], type[Watcher]]:
    """Makes a function over one batch a `Watcher` that remembers nothing."""

    def made(look: Look) -> type[Watcher]:
        def see(_self: Watcher, view: View) -> Iterator[Found | Occurrence]:
            yield from look(view)

        return type(look.__name__, (Watcher,), {"rules": rules, "look": see, "__doc__": look.__doc__})

    return made


class Exercise(Protocol):
    """Collects what a capture exercised, in the words that pages use for what a rule needs."""

    def look(self, view: View) -> None:
        """The next batch."""

    def words(self) -> Iterable[str]:
        """What was there, such as `motors running`."""


@runtime_checkable
class Measures(Protocol):
    """What an `Exercise` may offer beside words.

    Names that vehicle files ask for: `escs` (how many), `running_s` (seconds with motors turning), `unit N` (node ID of
    power unit N, in decimal).
    """

    def facts(self) -> Mapping[str, float]:
        """Numbers of the whole capture by name."""


@dataclass(frozen=True, slots=True)
class Conformance:
    """What a dissector's module adds to its pages, as its attribute `CONFORMANCE`.

    `labels` names units as people call them from a node's tables: it is given the view and yields (bus, node, label).
    """

    watchers: tuple[type[Watcher], ...] = ()
    exercises: tuple[type[Exercise], ...] = ()
    labels: Callable[[View], Iterable[tuple[int, int, str]]] | None = None
