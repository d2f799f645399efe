"""`-V`: everything about one transfer as a tree, down to the bits of its values and where they came from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import KINDS, STATUSES
from analyzer.views.details.branches import STEP, line, text
from analyzer.views.details.contents import PAYLOAD, part_templates
from analyzer.views.members import ALL, NOTHING
from analyzer.views.members import PLAIN as AS_IT_IS
from analyzer.views.named import rules_of
from analyzer.views.pick import Pick
from analyzer.views.sheets import Sheets, type_column, type_names, types_of
from analyzer.views.terminal import PLAIN, Palette, escape
from analyzer.views.times import MODES, TimeFormat
from analyzer.views.troubles import oddities
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers, pylist, valid

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.filter.memory import NamesFrames
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors import Registry
    from dissectors.kit import Array

_REQUEST, _ANONYMOUS = (KINDS.index(name) for name in ("request", "anonymous"))
_FRAMES_SHOWN = 8
_IDENTIFIER_BITS = 29
_BUS, _TYPE, _DAY, _NOTE = range(4)  # lists of words
_BESIDE = {
    "numbers": pa.list_(pa.int64()), "frames": pa.int64(), "type": pa.uint32(), "full": pa.bool_(),
    "identifier": pa.int64(), "elapsed": pa.int64(), "days": pa.uint32(), "since": pa.int64(), "took": pa.int64(),
    "good": pa.bool_(), "known": pa.bool_(), "note": pa.uint32(), "findings": pa.string(),
}  # fmt: skip
_NUMBER: Template = ("number", AS_IT_IS, ("plain",))


class Tree:
    """Writes the details of picked transfers.

    Args:
        registry: the types that the batches were decoded with.
        clock: writes relative times.
        palette: colours for a terminal.
        only: tables (`ESCStatus`, `uavcan.protocol.GetNodeInfo.Response`) to show in full; all if empty. Of other
            types only the first line is shown, as tshark's `-O` does.
        numbering: of frames; those of the capture if not given.
        named: the rules that name frames.
    """

    def __init__(
        self,
        registry: Registry,
        clock: TimeFormat,
        palette: Palette = PLAIN,
        only: Collection[str] = (),
        numbering: Numbering | None = None,
        named: NamesFrames | None = None,
    ) -> None:
        self._registry, self._clock, self._palette = registry, clock, palette
        self._only = frozenset(only)
        self._numbering = numbering or Numbering()
        self._named = named
        self._day = TimeFormat("ad", digits=9)
        self._shape: tuple[int | None, bool] = (None, False)
        self._sheets = Sheets(registry, self._row, part_templates, _BESIDE, first=PAYLOAD, escaped=True)

    def texts(self, batch: Batch, picked: Array | None = None) -> Iterator[str]:
        """Give the lines of each picked transfer (all if not given), in order."""
        self._clock.start(batch.frames)
        pick = Pick(batch, picked)
        if not len(pick):
            return iter(())
        batch, rows, transfers = pick.batch, pick.rows, pick.batch.transfers
        if self._shape != (self._clock.digits, self._clock.signed):
            self._shape = self._clock.digits, self._clock.signed
            self._sheets.compile()
        types, column = type_column(batch, self._registry)
        places, t = numbers(column), transfers.column("t")
        full = [not self._only or (one is not None and one.table in self._only) for one in types]
        days, seconds = self._day.days(t)
        note, noted = oddities(batch, rows, -1, self._notes)
        beside = {
            "type": column, "full": pa.array(np.array(full)[places]), "elapsed": self._day.elapsed(t), "days": days,
            "known": pa.array(np.array([one is not None for one in types])[places]), "note": note,
            **self._measures(batch),
        }  # fmt: skip
        if self._named is not None:
            rules = rules_of(self._named, pylist(transfers.column("frame")))
            beside["findings"] = pa.array(map(", ".join, rules), pa.string())
        detailed = {one.table for one, whole in zip(types, full, strict=True) if one is not None and whole}
        shown = [one for one in types_of(types, column, rows) if one.table in detailed]
        lists = [list(map(escape, batch.buses)), type_names(batch, types, column), seconds, noted]
        return self._sheets.texts(batch, rows, shown, beside, lists)

    def _notes(self, said: Sequence[str]) -> str:
        return "".join(f"{STEP}{self._palette.paint('note', f'{STEP}! {word}')}\n" for word in said)

    def _measures(self, batch: Batch) -> dict[str, pa.Array]:
        """Return columns about transfers that follow from others."""
        transfers = batch.transfers
        frames = transfers.column("frame")
        ends = np.asarray(frames.offsets)
        places = numbers(frames.values)[ends[0] : ends[-1]].astype(np.int64)
        numbered = pa.array(self._numbering.of_all(places))
        t, end, wire, here = (numbers(transfers.column(name)) for name in ("t", "t_end", "crc_wire", "crc_here"))
        timed = valid(transfers.column("t"))
        return {
            "numbers": pa.ListArray.from_arrays(pa.array(ends - ends[0], pa.int32()), numbered),
            "frames": pa.array(np.diff(ends), pa.int64()),
            "since": pa.array(t - (self._clock.zero or 0), mask=~timed),
            "took": pa.array(end - t, mask=~(timed & valid(transfers.column("t_end")))),
            "good": pa.array(wire == here),
            "identifier": pa.array(_identifiers(transfers)),
        }

    def _row(self, columns: SheetColumns) -> Template:
        """Return the template of the lines about a transfer."""
        title, note = self._palette.around("head"), self._palette.around("note")
        some: Template = ("each", ", ", _FRAMES_SHOWN, "", _NUMBER)
        frames = [text(", frame"), ("by", columns.place("frames"), [(1, NOTHING)], text("s")), text(" ")]
        frames += [columns.of("numbers", ("all", [some, ("beyond", _FRAMES_SHOWN, text(", ..."))]))]
        name, bus = columns.of("type", ("word", _TYPE)), columns.of("bus", ("word", _BUS))
        head = [text(title[0]), name, text(" on "), bus, *frames]
        head += [text(" ("), columns.of("frames", _NUMBER), text(f"){title[1]}\n")]
        if self._named is not None:
            rules = [text(f"{note[0]}{STEP}findings: "), ("copy",), text(f"{note[1]}\n")]
            head.append(columns.of("findings", ("unlike", "", ("all", rules))))
        what = ("by", columns.place("known"), [(1, text("Payload, not decoded"))], text("Payload of an unknown type"))
        payload = columns.of("payload", ("hex", " ", ALL, "no data", "", ""))
        undecoded = line(text(STEP), what, text(": "), payload)
        body = [*_identifier(columns), *self._transfer(columns), ("instead", undecoded, ("message", 0, ""))]
        return ("all", [*head, ("by", columns.place("full"), [(1, ("all", body))], NOTHING)])

    def _transfer(self, columns: SheetColumns) -> list[Template]:
        pad = STEP * 2
        statuses = [(code, text(name)) for code, name in enumerate(STATUSES)]
        zone = text(f" ({MODES['ad'].rpartition(', ')[2]})")
        time = line(text(f"{pad}time: "), self._day.template(columns, _DAY), zone)
        rule = ("switch", AS_IT_IS, [(1, NOTHING)], text(" (+1 is the rule)"))
        step = line(text(f"{pad}transfer ID step: +"), columns.of("step", ("all", [_NUMBER, rule])))
        since = "since zero" if self._clock.signed else "since first frame"
        return [
            line(text(f"{STEP}Transfer: "), columns.of("status", ("switch", AS_IT_IS, statuses, NOTHING))),
            ("given", columns.place("t"), time, line(text(f"{pad}time: not recorded"))),
            self._seconds(columns, "since", since, signed=self._clock.signed), self._seconds(columns, "took", "took"),
            ("given", columns.place("step"), step, NOTHING),
            self._seconds(columns, "gap", "since the previous one"),
            line(text(f"{pad}CRC: "), _checked(columns)), columns.of("note", ("word", _NOTE)),
        ]  # fmt: skip

    def _seconds(self, columns: SheetColumns, name: str, words: str, *, signed: bool = False) -> Template:
        shown = columns.of(name, ("number", AS_IT_IS, ("seconds", signed, self._clock.nine)))
        return ("given", columns.place(name), line(text(f"{STEP * 2}{words}: "), shown, text(" s")), NOTHING)


def _checked(columns: SheetColumns) -> Template:
    digits: Template = ("number", AS_IT_IS, ("format", "", "-", True, 4, None, "X"))
    wire, here = (columns.of(name, digits) for name in ("crc_wire", "crc_here"))
    good: Template = ("by", columns.place("good"), [(1, text("good"))], text("BAD"))
    checked: Template = ("all", [wire, text(", computed "), here, text(": "), good])
    both: Template = ("given", columns.place("crc_here"), checked, ("all", [wire, text(", not checked")]))
    few = [(count, text("none, a single frame has none")) for count in (0, 1)]
    return ("given", columns.place("crc_wire"), both, ("by", columns.place("frames"), few, text("not known")))


def _identifiers(transfers: pa.RecordBatch) -> Array:
    """Return identifiers (4.1.2), rebuilt from transfers; an anonymous one has bits that are not kept."""
    names = ("kind", "type_id", "src", "priority", "dst")
    kind, type_id, src, priority, dst = (numbers(transfers.column(name)).astype(np.int64) for name in names)
    to = np.where(valid(transfers.column("dst")), dst, 0)
    service = type_id << 16 | (kind == _REQUEST).astype(np.int64) << 15 | to << 8 | 1 << 7
    found: Array = priority << 24 | np.where(kind >= _REQUEST, service, type_id << 8) | src
    return found


def _identifier(columns: SheetColumns) -> list[Template]:
    """Return the templates of the fields of an identifier."""

    def part(low: int, high: int, *words: Template) -> Template:
        picture = columns.of("identifier", ("bits", AS_IT_IS, _IDENTIFIER_BITS, low, high))
        return line(text(STEP * 2), picture, text(" = "), *words)

    number, node = columns.of("type_id", _NUMBER), columns.of("src", _NUMBER)
    of_type = number, text(" ("), columns.of("type", ("word", _TYPE)), text(")")
    kinds = [(code, text(name)) for code, name in enumerate(KINDS)]
    service = [
        part(16, 23, text("service type: "), *of_type),
        part(15, 15, text("direction: "), columns.of("kind", ("switch", AS_IT_IS, kinds, NOTHING))),
        part(8, 14, text("destination node: "), columns.of("dst", ("or", "None", _NUMBER))),
        part(7, 7, text("service: yes")), part(0, 6, text("source node: "), node),
    ]  # fmt: skip
    bare = part(7, 7, text("service: no"))
    message = [part(8, 23, text("message type: "), *of_type), bare, part(0, 6, text("source node: "), node)]
    anonymous = [
        part(8, 9, text("message type: "), *of_type, text(", its low 2 bits")), bare,
        part(0, 6, text("source node: "), node, text(" (anonymous)")),
    ]  # fmt: skip
    digits: Template = ("number", AS_IT_IS, ("format", "", "-", True, 8, None, "X"))
    word: Template = ("all", [text(" "), columns.of("identifier", digits)])
    bits = [(_ANONYMOUS, text(", anonymous: bits 10-23 are no part of the type"))]
    cases = [(KINDS.index("message"), ("all", message)), (_ANONYMOUS, ("all", anonymous))]
    return [
        line(text(f"{STEP}Identifier"), ("by", columns.place("kind"), bits, word)),
        part(24, 28, text("priority: "), columns.of("priority", _NUMBER)),
        ("by", columns.place("kind"), cases, ("all", service)),
    ]
