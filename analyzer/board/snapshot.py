"""The state to show at one moment, as plain frozen data. Times and spans are integer nanoseconds.

Texts that came from the bus (names of nodes, notes, findings) are as they came: whoever shows them escapes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.kit import Severity

LatchKind = Literal["finding", "drop", "error", "restart", "flag", "silence", "note"]
Controller = Literal["", "error-active", "error-warning", "error-passive", "bus-off"]


@dataclass(frozen=True, slots=True)
class Tally:
    """Findings by severity."""

    errors: int = 0
    warnings: int = 0
    notes: int = 0


@dataclass(frozen=True, slots=True)
class BusRow:
    """One interface. `frames` and `load` (percent of `bit_rate`) are those of the last two seconds.

    `bit_rate` is `assumed` when nobody said it. `received`, `dropped` (by the kernel or the driver) and `here` (by this
    program, which was too slow) count from the start; so do `error_frames`. Counters of errors and the state are those
    of the last error frame that told them. `note` is the last one about this interface.
    """

    name: str
    frames: float
    load: float
    bit_rate: int
    assumed: bool
    received: int
    dropped: int
    here: int
    error_frames: int
    tx_errors: int | None
    rx_errors: int | None
    controller: Controller
    note: str
    silent: bool


@dataclass(frozen=True, slots=True)
class NodeRow:
    """One node. Rates (a second) are those of the last two seconds.

    `age` counts from its last whole or broken transfer; `gap` is the longest time between two NodeStatus since the
    mark, and so are `found` and `restarts`. `overdue` are transfers that have been open too long on a silent bus.
    """

    bus: str
    node: int
    name: str
    health: str
    mode: str
    uptime: int | None
    frames: float
    transfers: float
    age: int
    gap: int | None
    found: Tally
    restarts: int
    overdue: int
    stale: bool


@dataclass(frozen=True, slots=True)
class DeviceReading:
    """A quantity of one device: the last value, and the lowest and highest since the mark."""

    last: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Head:
    """A column of a table of devices. `whole` numbers have no decimals."""

    quantity: str
    role: str
    title: str
    unit: str
    whole: bool


@dataclass(frozen=True, slots=True)
class DeviceRow:
    """One device. `readings` are by (quantity, role), `states` the names of its states, `flags` of those set.

    `age` and `gap` (the longest since the mark) are those of what it reports of itself most often; None if it never
    does, and others only speak to it. `node` is the one that reports, 0 for none.
    """

    bus: str
    title: str
    label: str
    number: int
    node: int
    readings: Mapping[tuple[str, str], DeviceReading]
    states: tuple[str, ...]
    flags: tuple[str, ...]
    age: int | None
    gap: int | None
    found: Tally
    stale: bool


@dataclass(frozen=True, slots=True)
class DeviceTable:
    """The devices of one kind, such as those called ESC, in the order of their numbers."""

    kind: str
    title: str
    heads: tuple[Head, ...]
    rows: tuple[DeviceRow, ...]


@dataclass(frozen=True, slots=True)
class FindingRow:
    """A fault that one node repeats; `first` and `last` are the times at which the rules told of it."""

    rule: str
    severity: Severity
    category: str
    bus: str
    node: int
    type: str
    text: str
    first: int
    last: int
    count: int


@dataclass(frozen=True, slots=True)
class Latched:
    """Something that happened since the mark, whether anybody looked or not. `now` says that it still lasts."""

    kind: LatchKind
    subject: str
    text: str
    first: int
    last: int
    count: int
    now: bool = False


@dataclass(frozen=True, slots=True)
class RecordingState:
    """The file that is written, and if that works. `lost` are frames that did not get into it."""

    file: str
    size: int
    frames: int
    lost: int = 0
    problem: str = ""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of all interfaces at `now`. `since` is the time of mark number `marks`, or of the start.

    `findings` and `latched` are the newest first. `beyond` counts what no row was left for. `behind` is how long the
    oldest frame has waited that is not in it.
    """

    now: int
    since: int
    start: int
    marks: int = 0
    buses: tuple[BusRow, ...] = ()
    nodes: tuple[NodeRow, ...] = ()
    devices: tuple[DeviceTable, ...] = ()
    findings: tuple[FindingRow, ...] = ()
    found: Tally = field(default_factory=Tally)
    latched: tuple[Latched, ...] = ()
    notes: tuple[tuple[int, str], ...] = ()
    recording: RecordingState | None = None
    beyond: int = 0
    behind: int = 0
