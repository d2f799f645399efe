"""The packet list: one line a transfer, and below it what is odd about it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.remarks import Remarks
from analyzer.facts.names import type_name
from analyzer.tables import KINDS, STATUSES, TRANSFER_ANOMALIES
from analyzer.views.frames.loose import LooseFrames
from analyzer.views.frames.window import FrameWindow
from analyzer.views.marks import Marks
from analyzer.views.named import rules_of, tag
from analyzer.views.phrases import REMARK, octets, shortened, with_remarks
from analyzer.views.rows import TransferRows
from analyzer.views.terminal import PLAIN, Palette, display_width, escape, fit
from analyzer.views.wording import LISTED, anomalies
from analyzer.window.listed import ListedRows
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.devices.remarks import Remarked
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.marks import ListMark
    from analyzer.views.times import TimeFormat
    from dissectors import Registry
    from dissectors.schema import Message

_OK, _UNCHECKED, _BAD_CRC, _, _TIMED_OUT, _TOO_SHORT, _OPEN = range(len(STATUSES))
_REQUEST = KINDS.index("request")
_TOGGLE = 1 << TRANSFER_ANOMALIES.index("toggle")
_TIME_AND_SOURCE = 15
_MAX_TYPE = 24
_MAX_BUS = 16
_INDENT = " " * 11
_NARROWEST = (9, 12, 0)  # of time, type and bus
_STYLES = {"!": "bad", "x": "bad", "~": "dim", " ": "dim"}  # by the sign of a mark


class Listing:
    """Writes the list batch by batch: `feed(batch, picked)`, then `entries` with what stands `between` them.

    The widths of its columns are settled by the first batch.

    Args:
        registry: the types that the batches were decoded with.
        clock: writes the time column.
        palette: colours for a terminal.
        width: columns of the terminal, lines are cut there; None never cuts.
        frames: keeps the frames, and is fed by whoever made it; the list keeps some itself if not given.
        numbering: of frames; those of the capture if not given.
        foreign: list every frame that is not DroneCAN.
        named: the rules that name frames, to mark the rows with.
    """

    def __init__(
        self,
        registry: Registry,
        clock: TimeFormat,
        palette: Palette = PLAIN,
        width: int | None = None,
        *,
        frames: FrameWindow | None = None,
        numbering: Numbering | None = None,
        foreign: bool = False,
        named: NamedFrames | None = None,
    ) -> None:
        self._registry = registry
        self._clock = clock
        self._palette = palette
        self._width = width
        self._numbering = numbering or Numbering()
        self._own = FrameWindow() if frames is None else None
        self._named = named
        kept = self._own or frames or FrameWindow()
        self._loose = LooseFrames(registry, kept, self._numbering, foreign=foreign, named=named)
        self._marks = Marks(self._numbering)
        self._remarks = Remarks()
        self._names: tuple[str, ...] = ()
        self._rows: TransferRows | None = None
        self._times: list[str] = []
        self._types: list[str] = []
        self._head: list[str] = []
        self._buses = -1
        self._time, self._type, self._bus = _NARROWEST

    def lines(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Give all lines about a batch, of all its rows if not told which."""
        self.feed(batch, picked)
        for place, entry in zip(self.places(), self.entries(), strict=True):
            yield from self.between(place)
            yield from entry
        yield from self.between(None)

    def feed(self, batch: Batch, picked: ListedRows | None = None) -> None:
        """Take the next batch, and which of its rows to list: all if not given."""
        picked = ListedRows.all_of(batch) if picked is None else picked
        self._clock.start(batch.frames)
        if self._own is not None:
            self._own.feed(batch)
        self._marks.feed(batch, picked, self._loose.feed(batch, picked))
        self._names = batch.buses
        rows = self._rows = TransferRows(batch, self._registry, picked.transfers)
        self._times = self._clock.column(rows.all_times(), rows.picked.tolist())
        identities = zip(rows.messages, rows.column("kind"), rows.column("type_id"), strict=True)
        self._types = [type_name(message, kind, type_id) for message, kind, type_id in identities]
        if len(rows) and (self._buses < 0 or self._buses < 2 <= len(batch.buses)):
            self._head = [self._header(self._times, self._types)]

    def places(self) -> list[int]:
        """Return the places of the first frames of the transfers, from 0."""
        return [] if self._rows is None else [number - 1 for number in self._rows.first_frames()]

    def between(self, place: int | None, *, titled: bool = True) -> list[str]:
        """Give what stands before the transfer whose first frame has a place, for None behind all of them so far.

        The header comes with the first line, and again when a second interface turns up, since its column is shown from
        then on; `titled` asks for it.
        """
        waiting = list(self._marks.due(place))
        if waiting and self._buses < 0:
            self._head = [self._header([self._clock.text(waiting[0].t)], [mark.kind for mark in waiting])]
        head = self._head if titled and (waiting or place is not None) else []
        self._head = [] if head else self._head
        return [*head, *map(self._mark, waiting)]

    def end(self, *, titled: bool = True) -> list[str]:
        """Give what stands behind everything: the sums of foreign frames. `titled` as in `between`."""
        sums = list(self._loose.sums())
        if sums and self._buses < 0:
            self._head = [self._header([self._clock.text(sums[0].t)], [])]
        head, self._head = self._head, []
        return [*(head if titled else ()), *map(self._mark, sums)] if sums else []

    def entries(self) -> Iterator[list[str]]:
        """Give the lines of each picked transfer, without line ends."""
        return iter(()) if self._rows is None else self._body(self._rows, self._times, self._types)

    def _mark(self, mark: ListMark) -> str:
        names = list(map(escape, self._names))
        name = "" if mark.bus is None or not self._bus else fit(names[mark.bus], self._bus - 1)
        where = f"{self._clock.between(mark.t):>{self._time}}"
        source = max(_TIME_AND_SOURCE - len(where), self._time + 4 - len(where), 4)
        way = f"{mark.src:>{source}}>{mark.dst:<3} " if mark.dst else " " * (source + 5)
        bus = name + " " * (self._bus - display_width(name))
        kind = mark.kind if self._width is None else fit(mark.kind, self._type)
        number = "-" if mark.number is None else mark.number
        tid = "" if mark.transfer_id is None else mark.transfer_id
        line = f"{mark.sign}{number:>8}  {where}{way}{bus}{kind:<{self._type}} {tid:>2}  {escape(mark.text)}"
        return self._palette.paint(_STYLES[mark.sign], self._cut(line))

    def _header(self, times: list[str], types: list[str]) -> str:
        self._buses = len(self._names)
        self._time = max(9, len(times[0]), len(times[-1]))
        self._type = min(
            max(12, *map(len, types), 0), 16 if self._width is not None and self._width < 120 else _MAX_TYPE
        )
        names = [len(escape(name)) for name in self._names] if self._buses > 1 else []
        self._bus = max(3, min(max(names), _MAX_BUS)) + 1 if names else 0
        source = "Src".rjust(max(4, _TIME_AND_SOURCE - self._time))
        bus = "Bus".ljust(self._bus) if self._bus else ""
        text = f"    Frame  {self._clock.head:<{self._time}}{source}>Dst {bus}{'Type':<{self._type}} ID  Info"
        return self._palette.paint("head", self._cut(text))

    def _body(self, rows: TransferRows, times: list[str], types: list[str]) -> Iterator[list[str]]:
        width, palette, shown = self._type, self._palette, max(_TIME_AND_SOURCE, self._time + 4)
        status, odd = rows.column("status"), rows.column("anomaly")
        buses = self._bus_texts(rows)
        narrow = self._width is not None
        frames = self._numbering.of_all(np.array(self.places(), np.int64)).tolist()
        cells = zip(
            frames, times, rows.column("src"), rows.column("dst"), buses, types,
            rows.column("transfer_id"), self._infos(rows), status, odd, rows.column("step"), strict=True,
        )  # fmt: skip
        for frame, time, src, dst, bus, kind, tid, info, code, bits, step in cells:
            broken = code > _UNCHECKED
            name = fit(kind, width) if narrow else kind
            where = f"{time:>{self._time}}"
            line = (
                f"{'x' if broken else ' '}{frame:>8}  {where}{src:>{shown - len(where)}}>"
                f"{'*' if dst is None else dst:<3} {bus}{name:<{width}} {tid:>2}  "
            )
            room = None if self._width is None else self._width - display_width(line)
            line = self._cut(line + (info.replace(REMARK, " ") if room is None else shortened(info, max(room, 0))))
            entry = [palette.paint("bad", line) if broken else line]
            if bits & LISTED:
                note = f"{_INDENT}! {'; '.join(anomalies(bits & LISTED, step))}"
                entry.append(palette.paint("note", self._cut(note)))
            yield entry

    def _infos(self, rows: TransferRows) -> list[str]:
        infos = _infos(rows, self._remarks)
        if self._named is None:
            return infos
        named = rules_of(self._named, rows.column("frame"))
        return [tag(rules) + info for rules, info in zip(named, infos, strict=True)]

    def _bus_texts(self, rows: TransferRows) -> Iterable[str]:
        if not self._bus:
            return [""] * len(rows)
        names = [escape(name) for name in rows.batch.buses]
        if self._width is not None:
            names = [fit(name, self._bus - 1) for name in names]
        names = [name + " " * max(1, self._bus - display_width(name)) for name in names]
        return [names[bus] for bus in rows.column("bus")]

    def _cut(self, line: str) -> str:
        return line if self._width is None else fit(line, self._width)


def _infos(rows: TransferRows, remarks: Remarks) -> list[str]:
    """Return what each transfer says."""
    infos: list[str] = [""] * len(rows)
    tables = ((part.name, part.of, part.table) for part in (*rows.typed, *rows.packets) if part.of is not None)
    remarked = remarks.feed(tables)
    for part in rows.typed:
        for at, text in zip(part.at, with_remarks(part, remarked[part.name]), strict=True):
            infos[at] = text
    _add_packets(rows, infos, remarked)
    for part in rows.typed:
        left = numbers(part.table.column("bits_left"))
        for row in np.flatnonzero(left < 0).tolist():
            missing = -(int(left[row]) // 8)
            infos[part.at[row]] += f" ({missing} byte{'s' * (missing != 1)} missing)"
    for at in np.flatnonzero(rows.array("kind") >= _REQUEST).tolist():
        kind = KINDS[rows.column("kind")[at]]
        infos[at] = f"{kind}: {infos[at]}" if infos[at] else kind
    for at in np.flatnonzero(rows.array("status") != _OK).tolist():
        infos[at] = _troubled(rows, at, infos[at])
    return infos


def _add_packets(rows: TransferRows, infos: list[str], remarked: Mapping[str, Sequence[Remarked]]) -> None:
    texts = {id(part): with_remarks(part, remarked.get(part.name, ())) for part in rows.packets}
    sound = {id(part): part.table.column("packet_ok").to_pylist() for part in rows.packets if part.of is not None}
    for at, packets in rows.inner().items():
        said = []
        for _, part, row in packets:
            text = texts[id(part)][row]
            if part.of is not None:
                text = f"{part.of.name} {text}" + ("" if sound[id(part)][row] else " (packet damaged)")
            said.append(text)
        infos[at] = " | ".join(filter(None, [*said, infos[at]]))


def _troubled(rows: TransferRows, at: int, info: str) -> str:
    code = rows.column("status")[at]
    if code == _UNCHECKED:
        return octets(rows.column("payload")[at])
    if code == _BAD_CRC:
        wire, here = rows.column("crc_wire")[at], rows.column("crc_here")[at]
        verdict = f"bad CRC {wire:04X}" if wire is not None else "bad CRC"
        return " ".join(filter(None, [info, verdict + (f", computed {here:04X}" if here is not None else "")]))
    return broken_words(
        code,
        len(rows.column("frame")[at]),
        len(rows.column("payload")[at]),
        None if rows.column("fd")[at] else rows.messages[at],
        gap=bool(rows.column("anomaly")[at] & _TOGGLE),
    )


def broken_words(status: int, frames: int, size: int, message: Message | None, *, gap: bool) -> str:
    """Say how far a broken transfer came, of how many frames if its type has one length; `gap`: some are missing."""
    total = _frames_of(message)
    if total is not None and frames < total:
        progress = f"{frames} of {total} frames"
    else:
        progress = f"{frames} frame{'s' * (frames != 1)}, {size} byte{'s' * (size != 1)}"
    if status == _TIMED_OUT:
        return f"timed out after {progress}"
    if status == _OPEN:
        return f"capture ends after {progress}"
    if status == _TOO_SHORT:
        return f"too short for a CRC: {progress}"
    return f"broken, {progress}" if gap else f"cut after {progress}"


def _frames_of(message: Message | None) -> int | None:
    """Return the frames of a classic CAN transfer, if the type has one length."""
    if message is None or message.min_bytes != message.max_bytes:
        return None
    return 1 if message.max_bytes <= 7 else -(-(message.max_bytes + 2) // 7)
