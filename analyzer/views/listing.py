"""The packet list: one line a transfer, and below it what is odd about it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.names import type_name
from analyzer.tables import KINDS, STATUSES, TRANSFER_ANOMALIES
from analyzer.views.marks import Marks
from analyzer.views.phrases import octets, phrases
from analyzer.views.rows import TransferRows
from analyzer.views.terminal import PLAIN, Palette, display_width, escape, fit
from analyzer.views.wording import LISTED, anomalies
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.decode.engine import Batch
    from analyzer.views.marks import ListMark
    from analyzer.views.times import TimeFormat
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Message

_OK, _UNCHECKED, _BAD_CRC, _, _TIMED_OUT, _TOO_SHORT, _OPEN = range(len(STATUSES))
_REQUEST = KINDS.index("request")
_TOGGLE = 1 << TRANSFER_ANOMALIES.index("toggle")
_TIME_AND_SOURCE = 15
_MAX_TYPE = 24
_MAX_BUS = 16
_INDENT = " " * 11


class Listing:
    """Writes the list batch by batch; the widths of its columns are settled by the first batch.

    Args:
        registry: the types that the batches were decoded with.
        clock: writes the time column.
        palette: colours for a terminal.
        width: columns of the terminal, lines are cut there; None never cuts.
    """

    def __init__(
        self, registry: Registry, clock: TimeFormat, palette: Palette = PLAIN, width: int | None = None
    ) -> None:
        self._registry = registry
        self._clock = clock
        self._palette = palette
        self._width = width
        self._marks = Marks()
        self._names: tuple[str, ...] = ()
        self._buses = -1
        self._time = self._type = self._bus = 0

    def lines(self, batch: Batch, picked: Array | None = None) -> Iterator[str]:
        """Give the lines of `entries`, one after another."""
        for entry in self.entries(batch, picked):
            yield from entry
        yield from self.rest()

    def entries(self, batch: Batch, picked: Array | None = None) -> Iterator[list[str]]:
        """Give the lines of each picked transfer (all if not given), without line ends; the header is in the first.

        The header is repeated when a second interface turns up, since its column is shown from then on.
        """
        self._clock.start(batch.frames)
        self._marks.feed(batch)
        self._names = batch.buses
        rows = TransferRows(batch, self._registry, picked)
        times = self._clock.column(rows.all_times(), rows.picked.tolist())
        if not len(rows):
            return
        types = [type_name(m, k, t) for m, k, t in self._identities(rows)]
        head = [self._header(times, types)] if self._buses < 0 or (self._buses < 2 <= len(batch.buses)) else []
        for first, entry in zip(rows.first_frames(), self._body(rows, times, types), strict=True):
            yield [*head, *map(self._mark, self._marks.due(first)), *entry]
            head = []

    def rest(self) -> list[str]:
        """Give the lines of error frames and losses behind the last transfer of the batches so far."""
        waiting = list(self._marks.due(None))
        head = [self._header([self._clock.text(waiting[0].t)], [""])] if waiting and self._buses < 0 else []
        return [*head, *map(self._mark, waiting)]

    def _mark(self, mark: ListMark) -> str:
        """Write a line without a frame number, source and transfer ID."""
        names = list(map(escape, self._names))
        name = "" if mark.bus is None or not self._bus else fit(names[mark.bus], self._bus - 1)
        where = f"{self._clock.text(mark.t):>{self._time}}"
        blank = " " * (max(_TIME_AND_SOURCE, self._time + 4) - len(where) + 5)
        bus = name + " " * (self._bus - display_width(name))
        line = f"!{'-':>8}  {where}{blank}{bus}{mark.kind:<{self._type}}     {escape(mark.text)}"
        return self._palette.paint("bad", self._cut(line))

    def _identities(self, rows: TransferRows) -> Iterator[tuple[Message | None, int, int]]:
        return zip(rows.messages, rows.column("kind"), rows.column("type_id"), strict=True)

    def _header(self, times: list[str], types: list[str]) -> str:
        self._buses = len(self._names)
        self._time = max(9, len(times[0]), len(times[-1]))
        self._type = min(max(12, *map(len, types)), 16 if self._width is not None and self._width < 120 else _MAX_TYPE)
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
        cells = zip(
            rows.first_frames(), times, rows.column("src"), rows.column("dst"), buses, types,
            rows.column("transfer_id"), _infos(rows), status, odd, rows.column("step"), strict=True,
        )  # fmt: skip
        for frame, time, src, dst, bus, kind, tid, info, code, bits, step in cells:
            broken = code > _UNCHECKED
            name = fit(kind, width) if narrow else kind
            where = f"{time:>{self._time}}"
            line = (
                f"{'x' if broken else ' '}{frame:>8}  {where}{src:>{shown - len(where)}}>"
                f"{'*' if dst is None else dst:<3} {bus}{name:<{width}} {tid:>2}  {info}"
            )
            if narrow:
                line = self._cut(line)
            entry = [palette.paint("bad", line) if broken else line]
            if bits & LISTED:
                note = f"{_INDENT}! {'; '.join(anomalies(bits & LISTED, step))}"
                entry.append(palette.paint("note", self._cut(note)))
            yield entry

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


def _infos(rows: TransferRows) -> list[str]:
    """Return what each transfer says."""
    infos: list[str] = [""] * len(rows)
    for part in rows.typed:
        for at, text in zip(part.at, phrases(part), strict=True):
            infos[at] = text
    _add_packets(rows, infos)
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


def _add_packets(rows: TransferRows, infos: list[str]) -> None:
    texts = {id(part): phrases(part) for part in rows.packets}
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
