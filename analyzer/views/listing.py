"""The packet list: one line a transfer, and below it what is odd about it."""

from __future__ import annotations

from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import KINDS, distinct
from analyzer.views.frames.loose import LooseRows
from analyzer.views.frames.window import FrameWindow
from analyzer.views.marks import Marks
from analyzer.views.members import NOTHING
from analyzer.views.members import PLAIN as AS_IT_IS
from analyzer.views.named import rules_of, tag
from analyzer.views.phrases import OCTETS, REMARK, Phrases, shortened
from analyzer.views.pick import Pick
from analyzer.views.sheets import Sheets, type_column, type_names, types_of
from analyzer.views.terminal import PLAIN, Palette, display_width, escape, fit, fit_name
from analyzer.views.troubles import oddities, troubles
from analyzer.views.wording import LISTED
from analyzer.window.first_frames import first_frames
from analyzer.window.listed import ListedRows
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers, pylist

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.filter.memory import NamesFrames
    from analyzer.views.colours.painter import Painter
    from analyzer.views.marks import ListMark
    from analyzer.views.sheets import SheetColumns, Template
    from analyzer.views.times import TimeFormat
    from dissectors import Registry
    from dissectors.kit import Array

_OK, _UNCHECKED, _BAD_CRC = range(3)  # places in STATUSES
_TIME_AND_SOURCE = 15
_MAX_TYPE = 24
_MAX_BUS = 16
_INDENT = " " * 11
_NARROWEST = (9, 12, 0)  # of time, type and bus
_STYLES = {"!": "bad", "x": "bad", "~": "dim", " ": "dim"}  # by the sign of a mark
_INFO = "\x00"  # between the columns and what a transfer says, where a line may have to be cut
_BUS, _TYPE, _DAY, _TROUBLE, _NOTE = range(5)  # lists of words
_BESIDE = {
    "number": pa.int64(), "elapsed": pa.int64(), "days": pa.uint32(), "type": pa.uint32(), "trouble": pa.uint32(),
    "note": pa.uint32(), "tag": pa.string(),
}  # fmt: skip
_NUMBER: Template = ("number", AS_IT_IS, ("plain",))


class Listing:
    """Writes the list batch by batch: `feed(batch, picked)`, then `entries` with what stands `before` each.

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
        painter: finds the colours of rows; without one broken ones are red.
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
        named: NamesFrames | None = None,
        painter: Painter | None = None,
    ) -> None:
        self._registry = registry
        self._clock = clock
        self._palette = palette
        self._width = width
        self._numbering = numbering or Numbering()
        self._own = FrameWindow() if frames is None else None
        self._named = named
        self._painter = painter
        self._colours: list[str | None] = []  # of the entries
        kept = self._own or frames or FrameWindow()
        self._loose = LooseRows(registry, kept, self._numbering, foreign=foreign, named=named)
        self._marks = Marks(self._numbering)
        self._phrases = Phrases(registry, " " if width is None else REMARK)
        self._names: tuple[str, ...] = ()
        self._head = ""
        self._buses = -1
        self._time, self._type, self._bus = _NARROWEST
        self._shape: tuple[int | None, ...] = ()
        self._places: list[int] = []
        self._entries: Iterator[str] = iter(())
        self._sheets = Sheets(registry, self._row, self._phrases.part, _BESIDE, escaped=True)

    def lines(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Give all lines about a batch, of all its rows if not told which, without line ends."""
        self.feed(batch, picked)
        for place, entry in zip(self.places(), self.entries(), strict=True):
            yield from (self.before(place) + entry).splitlines()
        yield from self.before(None).splitlines()

    def feed(self, batch: Batch, picked: ListedRows | None = None) -> None:
        """Take the next batch, and which of its rows to list: all if not given."""
        picked = ListedRows.all_of(batch) if picked is None else picked
        self._clock.start(batch.frames)
        if self._own is not None:
            self._own.feed(batch)
        colours = None if self._painter is None else self._painter.feed(batch, picked)
        self._colours = [] if colours is None else colours.transfers
        self._marks.feed(batch, picked, self._loose.feed(batch, picked), colours)
        self._names = batch.buses
        pick = Pick(batch, picked.transfers)
        first = first_frames(pick.batch.transfers, pick.rows)
        self._places = first.tolist()
        elapsed = pick.elapsed(self._clock)
        self._entries = self._texts(pick, first, elapsed) if self._places else iter(())

    def places(self) -> list[int]:
        """Return the places of the first frames of the transfers, from 0."""
        return self._places

    def before(self, place: int | None, *, titled: bool = True) -> str:
        """Give the lines before the transfer whose first frame has a place, for None those behind all of them so far.

        The header comes with the first line, and again when a second interface turns up, since its column is shown from
        then on; `titled` asks for it.
        """
        if not self._head and not self._marks.waiting:
            return ""
        due = list(self._marks.due(place))
        if due and self._buses < 0:
            self._head = self._header([self._clock.text(due[0].t)], [mark.kind for mark in due])
        head = self._head if titled and (due or place is not None) else ""
        self._head = "" if head else self._head
        return head + "".join(map(self._mark, due))

    def end(self, *, titled: bool = True) -> str:
        """Give what stands behind everything: the sums of foreign frames. `titled` as in `before`."""
        sums = list(self._loose.sums())
        if sums and self._buses < 0:
            self._head = self._header([self._clock.text(sums[0].t)], [])
        head, self._head = self._head, ""
        return (head if titled and sums else "") + "".join(map(self._mark, sums))

    def entries(self) -> Iterator[str]:
        """Give the lines of each picked transfer."""
        if self._width is None and not self._palette.on:
            return self._entries
        return map(self._finish, self._entries, self._colours or repeat(None))

    def _mark(self, mark: ListMark) -> str:
        names = list(map(escape, self._names))
        name = "" if mark.bus is None or not self._bus else self._bus_name(names[mark.bus])
        where = f"{self._clock.between(mark.t):>{self._time}}"
        source = max(_TIME_AND_SOURCE - len(where), self._time + 4 - len(where), 4)
        way = f"{mark.src:>{source}}>{mark.dst:<3} " if mark.dst else " " * (source + 5)
        bus = name + " " * max(1 if self._bus else 0, self._bus - display_width(name))
        kind = mark.kind if self._width is None else fit(mark.kind, self._type)
        number = "-" if mark.number is None else mark.number
        tid = "" if mark.transfer_id is None else mark.transfer_id
        line = f"{mark.sign}{number:>8}  {where}{way}{bus}{kind:<{self._type}} {tid:>2}  {escape(mark.text)}"
        line = self._cut(line)
        if mark.colour is not None:
            return self._palette.colour(mark.colour, line) + "\n"
        return self._palette.paint(_STYLES[mark.sign], line) + "\n"

    def _header(self, times: Sequence[str], types: Sequence[str]) -> str:
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
        return self._palette.paint("head", self._cut(text)) + "\n"

    def _texts(self, pick: Pick, first: Array, elapsed: pa.Array) -> Iterator[str]:
        batch, rows, transfers = pick.batch, pick.rows, pick.batch.transfers
        types, column = type_column(batch, self._registry, rows)
        names, places = type_names(batch, types, column, rows), numbers(column)
        days, seconds = self._clock.days(transfers.column("t"))
        if self._buses < 0 or self._buses < 2 <= len(batch.buses):
            ends = [self._clock.written(elapsed, days, seconds, int(rows[k])) for k in (0, -1)]
            self._head = self._header(ends, [names[place] for place in distinct(places[rows])])
        trouble, troubled = troubles(batch, types, places, rows)
        note, noted = oddities(batch, rows, LISTED, _note)
        number = np.zeros(len(transfers), np.int64)
        number[rows] = self._numbering.of_all(first)
        beside = {
            "number": pa.array(number), "elapsed": elapsed, "days": days, "type": column,
            "trouble": trouble, "note": note,
        }  # fmt: skip
        if self._named is not None:
            rules = rules_of(self._named, pylist(transfers.column("frame")))
            beside["tag"] = pa.array(map(tag, rules), pa.string())
        shape = self._time, self._type, self._bus, self._clock.digits
        if shape != self._shape:
            self._shape = shape
            self._sheets.compile()
        narrow = self._width is not None
        words = [f"{fit(name, self._type) if narrow else name:<{self._type}}" for name in names]
        messages = types_of(types, column, rows)
        self._phrases.feed(batch, messages, rows)
        lists = [self._bus_words(), words, seconds, troubled, noted]
        return self._sheets.texts(batch, rows, messages, beside, lists)

    def _row(self, columns: SheetColumns) -> Template:
        """Return the template of the lines of a transfer."""
        time: Template = ("pad", self._time, False, self._clock.template(columns, _DAY))
        source = columns.of("src", _NUMBER)
        signs = [(code, ("text", " ")) for code in (_OK, _UNCHECKED)]
        return ("all", [
            columns.of("status", ("switch", AS_IT_IS, signs, ("text", "x"))),
            ("pad", 8, False, columns.of("number", _NUMBER)), ("text", "  "),
            ("apart", max(_TIME_AND_SOURCE, self._time + 4), time, source), ("text", ">"),
            ("pad", 3, True, columns.of("dst", ("or", "*", _NUMBER))), ("text", " "),
            *([columns.of("bus", ("word", _BUS))] if self._bus else []), columns.of("type", ("word", _TYPE)),
            ("text", " "), ("pad", 2, False, columns.of("transfer_id", _NUMBER)),
            ("text", "  " if self._width is None else f"  {_INFO}"),
            *([] if self._named is None else [columns.of("tag", ("copy",))]), _info(columns),
            ("text", "\n"), columns.of("note", ("word", _NOTE)),
        ])  # fmt: skip

    def _finish(self, text: str, colour: str | None) -> str:
        """Cut the lines of a transfer for a terminal, and paint them; `colour` is that of a rule, if one holds."""
        line, *below = text.splitlines()
        if self._width is not None:
            where, _, info = line.partition(_INFO)
            line = self._cut(where + shortened(info, max(self._width - display_width(where), 0)))
        if colour is not None:
            line = self._palette.colour(colour, line)
        elif line.startswith("x"):
            line = self._palette.paint("bad", line)
        return "\n".join([line, *(self._palette.paint("note", self._cut(one)) for one in below), ""])

    def _bus_words(self) -> list[str]:
        if not self._bus:
            return []
        names = [self._bus_name(escape(name)) for name in self._names]
        return [name + " " * max(1, self._bus - display_width(name)) for name in names]

    def _bus_name(self, name: str) -> str:
        return name if self._width is None else fit_name(name, self._bus - 1)

    def _cut(self, line: str) -> str:
        return line if self._width is None else fit(line, self._width)


def _note(said: Sequence[str]) -> str:
    return f"{_INDENT}! {'; '.join(said)}\n"


def _info(columns: SheetColumns) -> Template:
    """Return the template of what a transfer says."""
    message: Template = ("message", 0, "")
    halves = [(KINDS.index(name), ("headed", name, ": ", message)) for name in ("request", "response")]
    said: Template = ("by", columns.place("kind"), halves, message)
    digits: Template = ("number", AS_IT_IS, ("format", "", "-", True, 4, None, "X"))
    wire, here = (
        ("given", columns.place(name), ("all", [("text", text), columns.of(name, digits)]), NOTHING)
        for name, text in (("crc_wire", " "), ("crc_here", ", computed "))
    )
    damaged: Template = ("joined", " ", [said, ("all", [("text", "bad CRC"), wire, here])])
    cases = [(_OK, said), (_UNCHECKED, columns.of("payload", OCTETS)), (_BAD_CRC, damaged)]
    return ("by", columns.place("status"), cases, columns.of("trouble", ("word", _TROUBLE)))
