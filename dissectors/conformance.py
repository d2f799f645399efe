"""The vocabulary of conformance rules: what a rule sees of a capture, and how it says what it found.

A dissector's folder may hold rules that join its own tables; `analyzer.rules` runs them beside those that hold for any
bus. Both sides speak in the terms below, so that neither imports the other. Times are integer nanoseconds, frames and
transfers are numbered through the whole capture from 0.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from dissectors.schema import Message

Words = npt.NDArray[Any]
Values = Mapping[str, Any]
Severity = Literal["error", "warning", "note"]

MILLISECOND = 1_000_000
SECOND = 1_000_000_000
# In place of a time that a capture does not have.
NO_TIME = int(np.iinfo(np.int64).min)


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One breach of a rule. `frames` are its evidence, the first one is its place; none for a silence.

    `type` is the name of a table. `values` fill the text of the rule's page and make up its key. `severity` stands
    instead of the page's. `dialects` maps the reading that the node turns out to use to another severity, or to None
    if it is no breach then. `drops` makes it a note close to frames that the recorder lost. `lines` are the evidence
    as `View.lines` gave it, for a rule that holds an occurrence back.
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


class Kept(NamedTuple):
    """A frame of the recent past; `id` without flag bits, `flags` and `verdict` as in the table of frames."""

    t: int
    bus: int
    id: int
    flags: int
    data: bytes
    verdict: int


class Frames(Sized, Protocol):
    """The frames of a batch, column by column. `t` is `NO_TIME` where a capture has no time."""

    first: int
    t: Words
    bus: Words
    id: Words
    flags: Words
    line: Words
    verdict: Words
    anomaly: Words

    @property
    def length(self) -> Words:
        """Bytes of each data field."""

    def data(self, row: int) -> bytes:
        """The data field of a row of this batch, tail byte included."""


class Transfers(Sized, Protocol):
    """The transfers of a batch, in the order of their ends; columns as in the table of transfers.

    `t` and `t_end` are `NO_TIME` where there is no time. `lead` is the number of a transfer's first frame, `length`
    that of its payload bytes, `code` its type for `View.type_name`. Cells of `dst`, `crc_wire`, `crc_here`, `step` and
    `gap` that do not exist are arbitrary: ask `has`.
    """

    first: int
    t: Words
    t_end: Words
    bus: Words
    kind: Words
    type_id: Words
    variant: Words
    src: Words
    dst: Words
    priority: Words
    transfer_id: Words
    status: Words
    crc_wire: Words
    crc_here: Words
    step: Words
    gap: Words
    anomaly: Words
    fd: Words

    @property
    def lead(self) -> Words:
        """The number of each transfer's first frame, -1 for none."""

    @property
    def length(self) -> Words:
        """Payload bytes of each, CRC left out."""

    @property
    def code(self) -> Words:
        """Types, for `View.type_name`."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def frames(self, row: int) -> Sequence[int]:
        """Numbers of all frames of a transfer of this batch."""

    def payload(self, row: int) -> bytes:
        """The payload of a transfer of this batch, CRC left out."""


class Table(Sized, Container[str], Protocol):
    """One message or packet table of a batch. `row` are rows of its transfers in this batch.

    A packet's row stands once for each packet; `name` is the carrier's and its own (`PUSHCAN.MotorStatus`).
    """

    name: str

    @property
    def row(self) -> Words:
        """Rows of the transfers of this batch."""

    @property
    def t(self) -> Words:
        """Time of each transfer's first frame."""

    @property
    def bus(self) -> Words:
        """Index of the interface."""

    @property
    def src(self) -> Words:
        """Source node ID."""

    @property
    def trusted(self) -> Words:
        """Rows of complete transfers with a good CRC, or of one frame."""

    def __getitem__(self, column: str) -> Words:
        """A column of numbers as numpy; cells without a value are arbitrary."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def lists(self, column: str) -> tuple[Words, Words]:
        """A column of lists: where each row's begins (one entry more than rows), and all values."""

    def counts(self, column: str) -> Words:
        """How many elements each list of a column has; 0 in a column of anything else."""

    def cell(self, column: str, row: int) -> Any:
        """One cell as a Python value."""

    def not_finite(self, column: str) -> Iterable[tuple[str, Words, Words]]:
        """Floats of a field that are NaN or infinite: dotted name, rows in order, values; also inside structures."""


class Events(Sized, Protocol):
    """Error frames, drop counts, gaps, unreadable lines and comments of a batch; `kind` indexes `tables.EVENTS`."""

    t: Words
    bus: Words
    line: Words
    kind: Words
    tx_errors: Words
    rx_errors: Words

    @property
    def number(self) -> Words:
        """Error class bits, or frames dropped."""

    def has(self, column: str) -> Words:
        """Rows in which the column has a value."""

    def text(self, row: int) -> str:
        """Reason and excerpt of an unreadable line, or a comment."""

    def data(self, row: int) -> bytes:
        """The data field of an error frame."""


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


@dataclass(frozen=True, slots=True)
class Conformance:
    """What a dissector's module adds to its pages, as its attribute `CONFORMANCE`.

    `labels` names units as people call them from a node's tables: it is given the view and yields (bus, node, label).
    """

    watchers: tuple[type[Watcher], ...] = ()
    exercises: tuple[type[Exercise], ...] = ()
    labels: Callable[[View], Iterable[tuple[int, int, str]]] | None = None
