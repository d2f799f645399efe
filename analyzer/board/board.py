"""The state of the bus now: batches, findings, counts and notes in, snapshots out."""

from __future__ import annotations

import re
from collections import deque
from heapq import nlargest
from typing import TYPE_CHECKING

from analyzer.board.buses import BusStates
from analyzer.board.devices import DeviceStates
from analyzer.board.findings import FindingRows
from analyzer.board.latches import MOST_LATCHED, PROGRESS, Latches
from analyzer.board.nodes import NodeStates
from analyzer.board.opened import OpenTransfers
from analyzer.board.snapshot import Snapshot
from analyzer.facts.node_status import NODE_STATUS
from dissectors.kit import NO_TIME, EventTable, FrameTable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.board.snapshot import Latched, RecordingState
    from analyzer.decode.engine import Batch
    from analyzer.report.newest import Change
    from dissectors import Registry
    from dissectors.kit import Array

_MOST_NOTES = 50
_NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


class Board:
    """Follows the interfaces of one session. Not safe for several threads: snapshots are.

    Args:
        registry: the types that frames are decoded with. Raises `ProfileError` for a wrong `plots.toml`.
        bit_rates: in bits a second by the name of each interface, None where nobody knows.

    Memory is bounded: nodes, devices, findings and what is latched each have a limit, and `Snapshot.beyond` counts what
    found no place.
    """

    def __init__(self, registry: Registry, bit_rates: Mapping[str, int | None]) -> None:
        self._latches = Latches()
        self._buses = BusStates(bit_rates, self._latches)
        self._nodes = NodeStates(self._latches)
        self._devices = DeviceStates(registry)
        self._findings = FindingRows(self._latches)
        self._opened = OpenTransfers()
        self._notes: deque[tuple[int, str]] = deque(maxlen=_MOST_NOTES)
        self._names: tuple[str, ...] = ()
        self._recording: RecordingState | None = None
        self._start = self._since = self._last = self._then = NO_TIME
        self._marks = self._behind = 0
        self._ages: Mapping[tuple[str, int], int] = {}

    def feed(self, batch: Batch, now_ns: int, bits: Array | None = None) -> None:
        """Take the next batch, known at `now_ns`; `bits` are the `bit_times` of its frames if somebody has them."""
        self._names = batch.buses
        frames = FrameTable(batch.frames, batch.first_frame)
        if len(frames):
            if frames.t[-1] != NO_TIME:
                self._last, self._then = int(frames.t[-1]), now_ns
                self._begin(int(frames.t[0]))
            self._buses.feed(frames, batch.buses, bits)
            self._opened.feed(frames)
        if len(batch.events):
            self._buses.feed_events(EventTable(batch.events), batch.buses)
        self._nodes.feed(batch.transfers)
        if (table := batch.messages.get(NODE_STATUS)) is not None:
            self._nodes.feed_status(table, batch.buses)
        self._nodes.names.feed(batch.messages)
        self._devices.feed(batch.messages, batch.buses)

    def take_findings(self, changes: Iterable[Change], now_ns: int) -> None:
        """Take findings that are new or have come up again, known at `now_ns`."""
        self._findings.feed(changes, self._names, now_ns)

    def take_counts(self, interface: str, received: int, dropped: int, here: int) -> None:
        """Take an interface's counts: frames received, dropped before its receiver, and dropped by this program."""
        self._buses.take_counts(interface, received, dropped, here)

    def take_recording(self, state: RecordingState | None) -> None:
        """Take how the recording goes."""
        self._recording = state

    def take_lag(self, behind: int, ages: Mapping[tuple[str, int], int]) -> None:
        """Take how far (ns) it is behind what comes, and how long ago nodes were heard, by bus and number."""
        self._behind, self._ages = behind, ages

    def note(self, text: str, now_ns: int) -> None:
        """Take a note, such as a link that went down; `NAME: text` belongs to an interface.

        It is latched, as one entry with what differs from it in numbers alone; how it goes (`PROGRESS`) is not.
        """
        t = self._frame_time(now_ns)
        self._begin(t)
        self._notes.appendleft((t, text))
        self._buses.note(text)
        if text.startswith(PROGRESS):
            return
        subject, _, rest = text.partition(": ") if ": " in text else ("", "", text)
        self._latches.put("note", (subject, _NUMBER.sub("", rest)), subject, rest, t)

    def mark(self, now_ns: int) -> None:
        """Set a mark: what is latched, the longest, lowest and highest begin anew."""
        self._since = self._frame_time(now_ns)
        self._marks += 1
        self._latches.clear()
        self._nodes.mark()
        self._devices.mark()
        self._findings.mark()

    def clear(self, now_ns: int) -> None:
        """Forget findings, what is latched, and nodes and devices that are gone; min and max stay."""
        now = self._frame_time(now_ns)
        self._latches.clear()
        self._findings.clear()
        self._nodes.clear(now)
        self._devices.clear(now)
        self._notes.clear()

    def snapshot(self, now_ns: int) -> Snapshot:
        """Return everything there is to show at `now_ns`."""
        now = self._frame_time(now_ns)
        found = self._findings.by_node
        overdue = self._opened.overdue(now, self._last) if self._last != NO_TIME else {}
        latched = [*self._latches.rows(), *self._devices.latched(now), *self._nodes.silences(now, self._names)]
        return Snapshot(
            now=now,
            since=now if self._since == NO_TIME else self._since,
            start=now if self._start == NO_TIME else self._start,
            marks=self._marks,
            buses=tuple(self._buses.rows(now)),
            nodes=tuple(self._nodes.rows(now, self._names, self._ages, found, overdue)),
            devices=tuple(self._devices.tables(now, self._names, self._ages, found)),
            findings=tuple(self._findings.rows()),
            found=self._findings.tally,
            latched=tuple(nlargest(MOST_LATCHED, latched, key=_latest)),
            notes=tuple(self._notes),
            recording=self._recording,
            beyond=self._nodes.beyond + self._devices.beyond + self._latches.beyond,
            behind=self._behind,
        )

    def _begin(self, t: int) -> None:
        if self._start == NO_TIME:
            self._start = self._since = t

    def _frame_time(self, now_ns: int) -> int:
        """Return `now_ns` on the clock of the frames, which need not be that of this machine."""
        return now_ns if self._last == NO_TIME else self._last + max(0, now_ns - self._then)


def _latest(one: Latched) -> tuple[int, int, str, str]:
    return one.last, one.first, one.subject, one.text
