"""`--frame-list`: one row a frame, as text or as records for programs."""

from __future__ import annotations

from itertools import repeat
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.facts.frame_comments import FrameComments
from analyzer.tables import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX, VERDICTS
from analyzer.views.colours.painter import NO_RULE
from analyzer.views.frames.cells import VERDICT_WORDS, FrameSheet, FrameWriter, bit_of, identifier
from analyzer.views.json_fields import HEX, array_template, member, object_template, quotes, text_of
from analyzer.views.members import ALL, NOTHING, PLAIN
from analyzer.views.named import tag
from analyzer.views.records import FINDINGS, csv_word
from analyzer.views.terminal import PLAIN as COLOURLESS
from analyzer.views.terminal import Palette, comment_line, display_width, escape, fit, fit_name
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.rows import FrameRows, ListedFrames
    from analyzer.views.sheets import SheetColumns, Template
    from analyzer.views.times import TimeFormat
    from analyzer.window.listed import ListedRows

KEYS = (
    "frame", "number", "t_ns", "bus", "kind", "id", "len", "data", "flags", "verdict", "transfer", "place",
)  # fmt: skip
_FLAGS = {"extended": EXTENDED, "remote": REMOTE, "fd": FD, "brs": BRS, "esi": ESI, "tx": TX, "rx": RX}
_MOST_BUS = 16
_BYTES = 16  # digits of the data of a classic frame
_BUS, _VERDICT, _TYPE, _DAY = range(4)  # lists of words
_GOOD = [VERDICTS.index(name) for name in ("used", "foreign")]
_DUPLICATE = VERDICTS.index("duplicate")
_NUMBER: Template = ("number", PLAIN, ("plain",))
_FROM_ONE: Template = ("number", PLAIN, ("from one",))


class FrameLines(FrameWriter):
    """The frames as lines for people: number, time, delta, bus, identifier, length, bytes, verdict, transfer."""

    def __init__(
        self, rows: FrameRows, clock: TimeFormat, palette: Palette = COLOURLESS, width: int | None = None, *,
        codes: Sequence[str] = (), comments: Mapping[int, str] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(rows)
        self._said = FrameComments(comments)
        self._comments = self._said.texts
        self._codes = (*codes, None)  # the last one is that of no rule
        self._clock, self._palette, self._width = clock, palette, width
        self._bus, self._time = 0, 0
        self._sheet: FrameSheet | None = None

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write each frame that is known for good; the first one, which settles the widths, behind the header."""
        self._clock.start(batch.frames)
        self._said.feed(batch)
        return super().rows(batch, picked)

    def _texts(self, table: ListedFrames) -> Iterator[str]:
        rows, clock = table.rows, self._clock
        elapsed = table.deltas() if clock.follows_all else clock.elapsed(rows.column("t"))
        days, seconds = clock.days(rows.column("t"))
        buses = [name if self._width is None else fit_name(name, _MOST_BUS) for name in map(escape, table.buses)]
        head = ""
        if self._sheet is None:
            first = rows.column("bus")[0].as_py()
            head = self._head(clock.written(elapsed, days, seconds, 0), buses[first])
            self._sheet = FrameSheet(self._template)
        beside = {"elapsed": elapsed, "days": days}
        if self._rows.marked:
            beside["tag"] = pa.array(map(tag, rows.column("rules").to_pylist()), pa.string())
        padded = [name + " " * max(0, self._bus - display_width(name)) for name in buses]
        texts = self._sheet.texts(table, beside, (padded, VERDICT_WORDS, table.types, seconds))
        if self._width is None and not self._palette.on:
            lines = texts
        else:
            colours = rows.column("colour").to_pylist() if "colour" in rows.schema.names else repeat(NO_RULE)
            lines = map(self._finished, texts, numbers(rows.column("verdict")).tolist(), colours)
        places = rows.column("place").to_pylist() if self._comments else repeat(None)
        for line, place in zip(lines, places, strict=False):
            text = self._comments.get(place) if place is not None else None
            below = "" if text is None else self._palette.paint("good", comment_line(text)) + "\n"
            yield head + line + below
            head = ""

    def _template(self, columns: SheetColumns) -> Template:
        data: Template = ("by", columns.place("remote"), [(1, ("text", "remote"))], columns.of("data", HEX))
        place = [
            ("text", " "), columns.of("part", _NUMBER), ("text", "/"), columns.of("of", _NUMBER), ("text", " "),
            columns.of("transfer", _NUMBER), ("text", " "), columns.of("type", ("word", _TYPE)),
        ]  # fmt: skip
        since: Template = ("number", PLAIN, ("seconds", False, self._clock.nine))
        return ("all", [
            ("pad", 8, False, columns.of("number", ("or", "-", _NUMBER))), ("text", " "),
            ("pad", self._time, False, self._clock.template(columns, _DAY)), ("text", " "),
            ("pad", 8, False, columns.of("since", since)), ("text", " "),
            columns.of("bus", ("word", _BUS)), ("text", " "), ("pad", 8, False, identifier(columns)), ("text", " "),
            ("pad", 2, False, columns.of("length", _NUMBER)), ("text", " "),
            ("pad", _BYTES, True, data), ("text", " "),
            *([columns.of("tag", ("copy",))] if self._rows.marked else []), columns.of("verdict", ("word", _VERDICT)),
            ("given", columns.place("part"), ("all", place), NOTHING), ("text", "\n"),
        ])  # fmt: skip

    def _head(self, time: str, bus: str) -> str:
        self._time, self._bus = max(9, len(time)), max(4, len(bus))
        head = self._cut(
            f"   Frame {self._clock.head:>{self._time}}    Delta {'Bus':<{self._bus}} {'ID':>8}  L "
            f"{'Data':<{_BYTES}} Verdict, transfer"
        )
        return self._palette.paint("head", head) + "\n"

    def _finished(self, text: str, verdict: int, rule: int) -> str:
        line, codes = self._cut(text[:-1]), self._codes[rule]
        if codes is not None:
            line = self._palette.colour(codes, line)
        elif verdict not in _GOOD:
            line = self._palette.paint("note" if verdict == _DUPLICATE else "bad", line)
        return line + "\n"

    def _cut(self, line: str) -> str:
        return line if self._width is None else fit(line, self._width)


class FrameRecords(FrameWriter):
    """The frames for programs, as `json`, `jsonl` or `csv` with the keys of `KEYS`.

    `frame` counts frames from 1, `number` is what was asked for; `id` and `data` are hexadecimal, `flags` names,
    `transfer` is the first frame of the transfer, `place` this frame's in it and how many there are.
    """

    def __init__(self, rows: FrameRows, form: str) -> None:
        super().__init__(rows)
        self._form, self._before = form, "\n"
        self._keys = (*KEYS, FINDINGS) if rows.marked else KEYS
        self._sheet = FrameSheet(self._template)

    def begin(self) -> str:
        """Write what stands before the first record."""
        return {"json": "[", "csv": ",".join(self._keys) + "\r\n"}.get(self._form, "")

    def end(self) -> str:
        """Write the frames that still waited, and what stands behind the last record."""
        return super().end() + ("\n]\n" if self._form == "json" else "")

    def _texts(self, table: ListedFrames) -> Iterator[str]:
        write = csv_word if self._form == "csv" else text_of
        words = [[write(name) for name in some] for some in (table.buses, VERDICT_WORDS)]
        texts = self._sheet.texts(table, {}, words)
        if self._form != "json":
            yield from texts
            return
        for text in texts:
            before, self._before = self._before, ",\n"
            yield before + text

    def _template(self, columns: SheetColumns) -> Template:
        spread = self._form == "csv"
        none = "" if spread else "null"
        known = {key: self._cell(columns, key, none, spread=spread) for key in self._keys}
        if not spread:
            end = "\n" if self._form == "jsonl" else ""
            return ("all", [object_template(member(*pair) for pair in known.items()), ("text", end)])
        commas = [("text", ",")] * len(known)
        return (
            "all",
            [*[one for pair in zip(commas, known.values(), strict=True) for one in pair][1:], ("text", "\r\n")],
        )

    def _cell(self, columns: SheetColumns, key: str, none: str, *, spread: bool) -> Template:
        def text(word: str) -> Template:
            return ("text", word if spread else text_of(word))

        def unless_error(template: Template, instead: str) -> Template:
            return ("by", columns.place("error"), [(1, ("text", instead))], template)

        def number(name: str, show: Template = _NUMBER) -> Template:
            return columns.of(name, ("or", none, show))

        def digits(template: Template) -> Template:
            return template if spread else quotes(template)

        flags: Template = ("joined", " " if spread else ",", [
            columns.of("flags", ("switch", bit_of(bit), [(1, text(name))], NOTHING)) for name, bit in _FLAGS.items()
        ])  # fmt: skip
        part = [columns.of("part", _NUMBER), ("text", "/" if spread else ","), columns.of("of", _NUMBER)]
        rules: Template = ("each", " ", ALL, "", ("copy",)) if spread else array_template(("json",))
        if key == FINDINGS:
            return columns.of("rules", rules)
        return {
            "frame": number("place", _FROM_ONE),
            "number": number("number"),
            "t_ns": number("t"),
            "bus": columns.of("bus", ("word", _BUS)),
            "kind": ("by", columns.place("error"), [(1, text("error frame"))], text("frame")),
            "id": unless_error(digits(identifier(columns)), none),
            "len": number("length"),
            "data": columns.of("data", digits(HEX)),
            "flags": unless_error(flags if spread else _listed(flags), "" if spread else "[]"),
            "verdict": unless_error(columns.of("verdict", ("word", _VERDICT)), none),
            "transfer": number("transfer"),
            "place": (
                "given",
                columns.place("part"),
                ("all", part) if spread else _listed(("all", part)),
                ("text", none),
            ),
        }[key]


def _listed(template: Template) -> Template:
    return ("all", [("text", "["), template, ("text", "]")])
