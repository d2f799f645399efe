"""A batch as rules see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from dissectors.kit.array import Array
    from dissectors.kit.decoded import Context, DecodedTable
    from dissectors.kit.definitions import Types
    from dissectors.kit.occurrence import Occurrences, Values
    from dissectors.kit.paces import PacedReports
    from dissectors.kit.tables import EventTable, FrameTable, TransferTable
    from dissectors.schema import Message

SESSION = 0xFF_FFFF
"""Bits of an identifier that the frames of one session have in common: all but the priority."""


class Kept(NamedTuple):
    """A frame of the recent past; `id` without flag bits, `flags` and `verdict` as in the table of frames."""

    t: int
    bus: int
    id: int
    flags: int
    data: bytes
    verdict: int


class Settled(NamedTuple):
    """Frames of earlier batches that are settled with this one: numbers, final verdicts, anomaly bits to add.

    Of those that are still `known`, the other columns are as in the table of frames; `tail` is the last byte, or 0.
    """

    number: Array
    verdict: Array
    anomaly: Array
    known: Array
    t: Array
    bus: Array
    id: Array
    flags: Array
    tail: Array

    def of(self, rows: Array) -> Settled:
        """Return some of them."""
        return Settled(*(column[rows] for column in self))


class Second(NamedTuple):
    """Frames of an interface one after the other in one second; `start` is where the second begins.

    `t` and `frame` are those of the first. A second that a batch or a step back in time cuts has several of these.
    """

    bus: int
    start: int
    t: int
    frame: int
    frames: int
    bits: int


class Seconds(NamedTuple):
    """The seconds of a batch in columns, as `Second` has them: of each interface in the order of its frames."""

    bus: Array
    start: Array
    t: Array
    frame: Array
    frames: Array
    bits: Array

    def each(self) -> Iterator[Second]:
        """Return them one by one."""
        return map(Second._make, zip(*(column.tolist() for column in self), strict=True))


class JointLoss(NamedTuple):
    """A place at which a sender lacks frames while others do, too: the recorder lost them.

    They were sent between two times, and between the frames of these two numbers; `senders` lack some then. What is
    within `reach` of that, in ns, has the same cause: more than nothing where little is sent. `place` is the last frame
    before it of all that lack some: that of a slow sender is far away.
    """

    bus: int
    since: int
    until: int
    frames: tuple[int, int]
    senders: int
    reach: int = 0
    place: int = 0


class JointLosses(NamedTuple):
    """Such places in columns, as `JointLoss` has them; `number` and `behind` are the two frames."""

    bus: Array
    since: Array
    until: Array
    number: Array
    behind: Array
    senders: Array
    reach: Array
    place: Array

    def take(self, rows: Array) -> JointLosses:
        """Return some of them."""
        return JointLosses(*(column[rows] for column in self))

    def each(self) -> Iterator[JointLoss]:
        """Return them one by one."""
        for bus, since, until, number, behind, *more in zip(*(column.tolist() for column in self), strict=True):
            yield JointLoss(bus, since, until, (number, behind), *more)


class View(Protocol):
    """All that a rule sees: one batch, the capture so far, and the settings."""

    @property
    def frames(self) -> FrameTable:
        """The frames of this batch."""

    @property
    def transfers(self) -> TransferTable:
        """The transfers that ended in this batch."""

    @property
    def events(self) -> EventTable:
        """Everything else that the capture has here."""

    @property
    def seconds(self) -> Seconds:
        """Frames and bits by interface and second, counted from the first frame of the capture."""

    @property
    def joint_losses(self) -> JointLosses | None:
        """Where several senders lack frames at the same time, of a few seconds ago: what is settled with this batch."""

    @property
    def settled(self) -> Settled:
        """Frames of earlier batches whose verdict is final now."""

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
        """Return since when frames have come without a gap (CAP-002), up to a time of this or the last batches.

        Nothing is known of what was sent in a gap, so nothing in front of it counts behind it. `NO_TIME` without times.
        """

    @property
    def gap_ends(self) -> Array:
        """When each gap (CAP-002) so far ended, the latest ones, in order: what `resumed` returns."""

    def paused(self, since: int, until: int) -> bool:
        """Return whether the capture has a gap between two times (CAP-002) that may hide what is missing.

        It does where frames came close together before it; a bus with little traffic is silent that long at any time.
        """

    @property
    def resolution(self) -> int:
        """The power of ten of nanoseconds that all times so far are multiples of, from the first one on."""

    @property
    def bit_rate(self) -> int | None:
        """Bits per second, if known."""

    @property
    def cut_in(self) -> bool:
        """True if what came before was left out on purpose: what begins in the middle then says nothing."""

    def table(self, name: str) -> DecodedTable | None:
        """Return the rows of a message (`ESCStatus`) or packet (`PUSHCAN.MotorStatus`) in this batch, None without."""

    def tables(self) -> Iterable[str]:
        """Return the names of the tables that this batch has."""

    @property
    def contexts(self) -> Sequence[Context]:
        """The message tables of this batch, small ones joined: for what is asked of all of them alike."""

    def definition(self, name: str) -> Message | None:
        """Return the type of a message table, None for other tables."""

    def number(self, rule: str, name: str) -> float:
        """Return a setting of a rule."""

    def type_name(self, code: int) -> str:
        """Return the name of a table by the code of a transfer's type; unknown types are named by their ID."""

    def type_of(self, code: int) -> Message | None:
        """Return what is known of a transfer's type by its code, None if it has no definition."""

    @property
    def types(self) -> Types:
        """The definitions of types."""

    def frame(self, number: int) -> Kept | None:
        """Return a frame of the recent past, None if it is gone."""

    def indexes(self, low: int, high: int) -> Sequence[Any]:
        """Return batches of the recent past with frames from `low` to before `high`, by session, for the core."""

    def paced_reports(self, least: int, periods: float, fewest: int, span: int = 0) -> PacedReports:
        """Return what looks for breaks in reports at a steady pace, of which there are none yet.

        Args:
            least: shorter times than this in ns are no breaks.
            periods: nor are shorter ones than so many periods.
            fewest: reports that show a period.
            span: how long in ns they have to go on, so that they are more than a few in a row.
        """

    def lines(self, frames: Iterable[int]) -> tuple[str, ...]:
        """Return frames of the recent past as candump writes them, the first 16."""

    def each_line(self, frames: Array) -> Array:
        """Return many frames of the recent past as candump writes them, one text each: an empty one if it is gone."""

    def choice(self, message: str, reading: str, bus: int, node: int) -> str:
        """Return what a node's doubtful field has shown so far; it depends on how the capture is cut into batches."""

    def among_transfers(self, rule: str, rows: Array, values: Callable[[int], Values], **about: Any) -> Occurrences:
        """Return breaches in transfers: `values` is asked with a row of the batch, `about` is what else they have."""

    def among_frames(self, rule: str, rows: Array, values: Callable[[int], Values], **about: Any) -> Occurrences:
        """Return breaches in frames, likewise; node and type are those of the identifier if it is DroneCAN's."""

    def among_rows(
        self, rule: str, table: DecodedTable, rows: Array, values: Callable[[int], Values], **about: Any
    ) -> Occurrences:
        """Return breaches in rows of a message or packet table, likewise."""
