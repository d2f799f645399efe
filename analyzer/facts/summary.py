"""Facts of a capture that `info` tells, as plain data.

An accumulator over batches with bounded memory, and its result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from analyzer.facts.names import type_name
from analyzer.facts.odd import compared
from analyzer.facts.recording import RecordingFacts, mixed
from analyzer.facts.senders import SenderFacts, Senders
from analyzer.facts.traffic import BIT_RATE, BusCount, Talk, TalkKey, Talks, TypeKey, times
from analyzer.tables import KINDS, STAMPS, distinct
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass, field
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import pyarrow as pa

    from analyzer.decode.engine import Batch, Engine
    from analyzer.decode.readings import Statement
    from analyzer.facts.traffic import ForeignIds
    from dissectors import Registry

MOST_CHANNELS = 32
YEAR_2000 = 946_684_800 * SECOND


class StoredCapture(Protocol):
    """A capture as it is stored; `analyzer.sources.Source` is one."""

    name: str
    size: int
    notes: list[str]

    @property
    def unit(self) -> str:
        """Return what its rows are counted in: line or record."""

    @property
    def form(self) -> str:
        """The format in words."""

    @property
    def digest(self) -> str:
        """SHA-256 in hexadecimal."""


@dataclass(frozen=True, slots=True)
class FileFacts:
    """One of the captures read, its rows counted in `unit`; `notes` says what its format does not hold."""

    name: str
    form: str
    unit: str
    size: int
    sha256: str
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BusFacts:
    """One interface. Rates are frames a second, None without times; `load` is percent of 1 Mbit/s, unstuffed."""

    name: str
    frames: int
    mean: float | None
    peak: int | None
    load: float | None


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """Transfers of one type that a node sends. Times in nanoseconds; `channels` are people's, from 1."""

    bus: str
    node: int
    sends: str
    kind: str
    type_id: int
    known: bool
    count: int
    bad: int
    hz: float | None
    first: int | None
    last: int | None
    channels: tuple[int, ...]
    software: str | None


@dataclass(frozen=True, slots=True)
class Facts:
    """A whole capture. `lines` and `verdicts` are the terms of the two conservation sums.

    `lossy` says that its recorder told of frames that it lost.
    """

    files: tuple[FileFacts, ...]
    start: int | None
    end: int | None
    absolute: bool
    stamps: tuple[str, ...]
    lines: Mapping[str, int]
    verdicts: Mapping[str, int]
    balanced: bool
    judge: Mapping[str, str]
    buses: tuple[BusFacts, ...]
    nodes: tuple[NodeFacts, ...]
    not_listed: int
    readings: tuple[Statement, ...]
    foreign: tuple[tuple[str, int], ...]
    transfers: int = 0
    broken: int = 0
    bus_names: tuple[str, ...] = field(default=())
    lossy: bool = False
    senders: tuple[SenderFacts, ...] = ()


class Summary:
    """Adds up batches; `finish` gives the facts.

    Args:
        registry: the types that the capture is decoded with.
        foreign: counts identifiers that are not DroneCAN, for who wants to see them.

    Bounds: `MOST_TALKS` combinations of bus, node and type, and those of `Senders` and `ForeignIds`.
    """

    def __init__(self, registry: Registry, foreign: ForeignIds | None = None) -> None:
        self._registry = registry
        self._buses: dict[int, BusCount] = {}
        self._names: tuple[str, ...] = ()
        self._talks = Talks()
        self._without_channels: set[TypeKey] = set()  # nobody needs their tables made
        self._foreign = foreign
        self._readings: tuple[Statement, ...] = ()
        self._senders = Senders()
        self._recording = RecordingFacts()

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._names, self._readings = batch.buses, batch.readings
        self._count_frames(batch)
        if self._foreign is not None:
            self._foreign.feed(batch)
        self._recording.feed(batch)
        for sent in self._talks.feed(batch.transfers) - self._without_channels:
            message = self._registry.message(*sent)
            table = batch.messages.get(message.table) if message is not None else None
            if table is not None:
                self._note_channels(sent, table)
        self._senders.feed(batch)

    @property
    def names(self) -> Mapping[tuple[int, int], str]:
        """Names that nodes give themselves, by (bus, node)."""
        return self._senders.names.all

    def finish(self, stored: Iterable[StoredCapture], engine: Engine) -> Facts:
        """Return everything that is known, after the last batch of the captures `stored`."""
        totals = engine.totals
        counted = self._buses.values()
        start = min((bus.first for bus in counted if bus.first is not None), default=None)
        end = max((bus.last for bus in counted if bus.last is not None), default=None)
        stamps = tuple(name for bit, name in enumerate(STAMPS) if engine.stamps >> bit & 1)
        timed = start is not None and not mixed(stamps)
        nodes = tuple(self._nodes(timed=timed))
        return Facts(
            files=tuple(FileFacts(s.name, s.form, s.unit, s.size, s.digest, tuple(s.notes)) for s in stored),
            start=start,
            end=end,
            absolute=start is not None and start >= YEAR_2000,
            stamps=stamps,
            lines=totals.lines,
            verdicts=totals.verdicts,
            balanced=totals.balanced,
            judge=self._recording.judge(totals, stamps, timed=timed),
            buses=tuple(self._bus_facts(timed=timed)),
            nodes=nodes,
            not_listed=self._talks.beyond,
            readings=self._readings,
            foreign=() if self._foreign is None else tuple(self._foreign.most()),
            transfers=sum(node.count for node in nodes) + self._talks.beyond,
            broken=sum(node.bad for node in nodes),
            bus_names=self._names,
            lossy=self._recording.lossy,
            senders=compared(self._senders.facts(self._talks.all, self._registry, self._names, timed=timed)),
        )

    def _count_frames(self, batch: Batch) -> None:
        frames = batch.frames
        if not len(frames):
            return
        bus, flags = numbers(frames.column("bus")), numbers(frames.column("flags"))
        data = frames.column("data")
        sizes = np.diff(np.frombuffer(data.buffers()[1], np.int32)[data.offset : data.offset + len(data) + 1])
        t, valid = times(frames)
        buses = distinct(bus)
        if len(buses) == 1 and valid.all():
            self._buses.setdefault(buses[0], BusCount()).feed(sizes, flags, t)
            return
        for index in buses:
            here = bus == index
            self._buses.setdefault(index, BusCount()).feed(sizes[here], flags[here], t[here & valid])

    def _note_channels(self, sent: TypeKey, table: pa.RecordBatch) -> None:
        """Note people's numbers of the ESCs that a node speaks for: the profile calls that column `channel`."""
        if "channel" not in table.schema.names:
            self._without_channels.add(sent)
            return
        column = table.column("channel")
        good = numbers(table.column("trusted")) & valid(column)
        node = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
        channels = np.rint(numbers(column)).astype(np.int64)
        for code in distinct((node << 32 | channels & 0xFFFF_FFFF)[good]):
            talk = self._talks.all.get((code >> 40, code >> 32 & 0xFF, sent))
            channel = code & 0xFFFF_FFFF
            if talk is not None and channel not in talk.channels and len(talk.channels) < MOST_CHANNELS:
                talk.channels |= {channel}

    def _bus_facts(self, *, timed: bool) -> Iterator[BusFacts]:
        for index, bus in sorted(self._buses.items()):
            span = None if bus.first is None or bus.last is None else bus.last - bus.first
            mean = load = None
            if span and timed:
                mean = (bus.frames - 1) * SECOND / span
                load = None if bus.fd else 100 * bus.bits * SECOND / span / BIT_RATE
            yield BusFacts(
                self._names[index], bus.frames, mean, bus.peak if mean and span and span >= SECOND else None, load
            )

    def _nodes(self, *, timed: bool) -> Iterator[NodeFacts]:
        for key, talk in sorted(self._talks.all.items()):
            yield self._node(key, talk, timed=timed)

    def _node(self, key: TalkKey, talk: Talk, *, timed: bool) -> NodeFacts:
        bus, src, (kind, type_id, variant) = key
        message = self._registry.message(kind, type_id, variant)
        return NodeFacts(
            bus=self._names[bus],
            node=src,
            sends=type_name(message, kind, type_id) if message is None else message.name,
            kind=KINDS[kind],
            type_id=type_id,
            known=message is not None,
            count=talk.count,
            bad=talk.bad,
            hz=talk.hz if timed else None,
            first=talk.first,
            last=talk.last,
            channels=tuple(sorted(talk.channels)),
            software=self._senders.software.all.get((bus, src)),
        )
