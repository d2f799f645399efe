"""`--frame-list`: one row a frame, as text or for programs."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

from analyzer.tables import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, RX, TX
from analyzer.views.json_fields import text_of
from analyzer.views.named import tag
from analyzer.views.records import FINDINGS, harmless
from analyzer.views.terminal import PLAIN, Palette, escape, fit
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.rows import FrameRow, FrameRows
    from analyzer.views.frames.window import RawFrame
    from analyzer.views.times import TimeFormat
    from analyzer.window.listed import ListedRows

KEYS = (
    "frame", "number", "t_ns", "bus", "kind", "id", "len", "data", "flags", "verdict", "transfer", "place",
)  # fmt: skip
_FLAGS = {"extended": EXTENDED, "remote": REMOTE, "fd": FD, "brs": BRS, "esi": ESI, "tx": TX, "rx": RX}
_MOST_BUS = 16
_BYTES = 16  # digits of the data of a classic frame
# Fields of `-T fields` that a frame has, from the row, its frame and the clocks of times.
FRAME_FIELDS: dict[str, Callable[[FrameRow], Any]] = {
    "frame.number": lambda row: row.number,
    "frame.interface_name": lambda row: escape(row.bus),
    "can.id": lambda row: None if row.frame.flags & ERROR else row.frame.id,
    "can.len": lambda row: _length(row.frame),
    "can.flags.xtd": lambda row: None if row.frame.flags & ERROR else int(row.frame.flag("xtd")),
    "can.flags.rtr": lambda row: int(row.frame.flag("rtr")),
    "can.flags.err": lambda row: int(row.frame.flag("err")),
}
FRAME_TIMES = {"frame.time_epoch": "e", "frame.time_relative": "r", "frame.time_delta": "d"}


class FrameText:
    """The frames as lines for people: number, time, delta, bus, identifier, length, bytes, verdict, transfer."""

    def __init__(self, rows: FrameRows, clock: TimeFormat, palette: Palette = PLAIN, width: int | None = None) -> None:
        self._rows, self._clock, self._palette, self._width = rows, clock, palette, width
        self._bus, self._time = 0, 0

    def begin(self) -> str:
        """Nothing: the header comes with the first frame, which settles its widths."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Give a line for each frame that is known for good."""
        self._clock.start(batch.frames)
        yield from map(self._line, self._rows.feed(batch, picked))

    def end(self) -> str:
        """Give the frames that still waited."""
        return "".join(map(self._line, self._rows.finish()))

    def _line(self, row: FrameRow) -> str:
        time, bus = self._clock.column([row.frame.t])[0], fit(escape(row.bus), _MOST_BUS)
        head = ""
        if not self._time:
            self._time, self._bus = max(9, len(time)), max(4, len(bus))
            head = self._cut(
                f"   Frame {self._clock.head:>{self._time}}    Delta {'Bus':<{self._bus}} {'ID':>8}  L "
                f"{'Data':<{_BYTES}} Verdict, transfer"
            )
            head = self._palette.paint("head", head) + "\n"
        since = "" if row.since is None else self._clock.seconds(row.since)
        number = "-" if row.number is None else row.number
        frame, good = row.frame, row.verdict == "used"
        said = tag(row.rules) + row.verdict
        if row.part is not None:
            said += f" {row.part[0]}/{row.part[1]} {row.transfer} {row.type}"
        name = "" if frame.flags & ERROR else frame.id_text
        data = "remote" if frame.flags & REMOTE else frame.data.hex().upper()
        line = self._cut(
            f"{number:>8} {time:>{self._time}} {since:>8} {bus:<{self._bus}} {name:>8} {_length(frame):>2} "
            f"{data:<{_BYTES}} {said}"
        )
        style = "note" if row.verdict == "duplicate" else "bad"
        plain = good or row.verdict == "foreign"
        return head + (line if plain else self._palette.paint(style, line)) + "\n"

    def _cut(self, line: str) -> str:
        return line if self._width is None else fit(line, self._width)


class FrameRecords:
    """The frames for programs, as `json`, `jsonl` or `csv` with the keys of `KEYS`.

    `frame` counts frames from 1, `number` is what was asked for; `id` and `data` are hexadecimal, `flags` names,
    `transfer` is the first frame of the transfer, `place` this frame's in it and how many there are.
    """

    def __init__(self, rows: FrameRows, form: str) -> None:
        self._rows, self._form, self._before = rows, form, "\n"

    def begin(self) -> str:
        """Write what stands before the first record."""
        keys = (*KEYS, FINDINGS) if self._rows.marked else KEYS
        return {"json": "[", "csv": ",".join(keys) + "\r\n"}.get(self._form, "")

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write a record for each frame that is known for good."""
        yield from map(self._text, self._rows.feed(batch, picked))

    def end(self) -> str:
        """Write the frames that still waited, and what stands behind the last record."""
        return "".join(map(self._text, self._rows.finish())) + ("\n]\n" if self._form == "json" else "")

    def _text(self, row: FrameRow) -> str:
        record = _record(row)
        if self._rows.marked:
            record[FINDINGS] = list(row.rules)
        if self._form == "csv":
            out = io.StringIO()
            flat = {**record, "flags": " ".join(record["flags"]), "place": "/".join(map(str, row.part or ()))}
            flat |= {FINDINGS: " ".join(row.rules)} if self._rows.marked else {}
            csv.writer(out).writerow([harmless(value) for value in flat.values()])
            return out.getvalue()
        if self._form == "jsonl":
            return text_of(record) + "\n"
        before, self._before = self._before, ",\n"
        return before + text_of(record)


class FrameFields:
    """Chosen fields of each frame, separated by tabs. Raises `ValueError` for one that frames do not have."""

    def __init__(self, rows: FrameRows, names: tuple[str, ...], zero: int | None) -> None:
        for name in names:
            if name not in FRAME_FIELDS and name not in FRAME_TIMES:
                known = ", ".join((*FRAME_FIELDS, *FRAME_TIMES))
                raise ValueError(f"--frame-list has no field {name!r}: frames have {known}")
        self._rows, self._names, self._zero = rows, names, zero

    def begin(self) -> str:
        """Write nothing."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write a line for each frame that is known for good."""
        yield from map(self._text, self._rows.feed(batch, picked))

    def end(self) -> str:
        """Write the frames that still waited."""
        return "".join(map(self._text, self._rows.finish()))

    def _text(self, row: FrameRow) -> str:
        return "\t".join(self._cell(row, name) for name in self._names) + "\n"

    def _cell(self, row: FrameRow, name: str) -> str:
        if name in FRAME_FIELDS:
            value = FRAME_FIELDS[name](row)
            return "" if value is None else str(value)
        t = row.frame.t
        if self._zero is None:
            self._zero = t
        if t is None:
            return ""
        since = row.since or 0
        ns = {"e": t, "r": t - (self._zero or 0), "d": since}[FRAME_TIMES[name]]
        return f"{'-' * (ns < 0)}{abs(ns) // SECOND}.{abs(ns) % SECOND:09d}"


def _record(row: FrameRow) -> dict[str, Any]:
    frame, error = row.frame, bool(row.frame.flags & ERROR)
    return {
        "frame": None if row.place is None else row.place + 1,
        "number": row.number,
        "t_ns": frame.t,
        "bus": row.bus,
        "kind": "error frame" if error else "frame",
        "id": None if error else frame.id_text,
        "len": _length(frame),
        "data": frame.data.hex().upper(),
        "flags": [] if error else [name for name, bit in _FLAGS.items() if frame.flags & bit],
        "verdict": None if error else row.verdict,
        "transfer": row.transfer,
        "place": None if row.part is None else list(row.part),
    }


def _length(frame: RawFrame) -> int:
    return frame.length_code if frame.flags & REMOTE else len(frame.data)
