"""Puts the views together as the options ask: what is written for each batch."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.frame_comments import FrameComments
from analyzer.tables import VERDICTS
from analyzer.views.details.hexdump import HexDumps
from analyzer.views.details.tree import Tree
from analyzer.views.fields import Fields
from analyzer.views.formats import BY_NAME
from analyzer.views.frames.window import FrameWindow
from analyzer.views.listing import Listing
from analyzer.views.terminal import PLAIN, Palette, comment_line
from analyzer.views.times import TimeFormat
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.colours.painter import Painter
    from analyzer.views.formats import Writer
    from analyzer.views.frames.rows import FrameMatcher
    from analyzer.views.options import WriterOptions
    from analyzer.window.listed import ListedRows
    from dissectors import Registry


_USED = VERDICTS.index("used")


class Text:
    """The list, the details and the bytes of each transfer, as far as they are asked for."""

    def __init__(
        self,
        options: WriterOptions,
        registry: Registry,
        clock: TimeFormat,
        numbering: Numbering,
        named: NamedFrames | None = None,
    ) -> None:
        self._details, self._bytes = options.details or options.only is not None, options.dumps
        self._summary = options.summary or not self._details
        self._palette = Palette(True) if options.colour else PLAIN
        only = [registry.resolve(name).table for name in options.only or ()]
        self._said = FrameComments(options.comments)
        self._comments = self._said.texts
        self._frames = FrameWindow()
        self._listing = Listing(
            registry,
            clock,
            self._palette,
            _width(),
            frames=self._frames,
            numbering=numbering,
            foreign=options.foreign,
            named=named,
            painter=_painter(options, registry),
        )
        self._dumps = HexDumps(registry, self._frames, self._palette, numbering)
        self._tree = Tree(registry, clock, self._palette, only, numbering, named)

    def begin(self) -> str:
        """Nothing: the header comes with the first transfer, which settles its widths."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Give the lines of each transfer together, before them those of what happened until it began."""
        self._frames.feed(batch)
        self._said.feed(batch)
        self._listing.feed(batch, picked)
        parts: list[Iterator[str]] = []
        if self._summary:
            parts.append(self._listing.entries())
        if self._details:
            parts.append(self._tree.texts(batch, picked.transfers))
        if self._bytes:
            parts.append(self._dumps.texts(batch, picked.transfers))
        entries = parts[0] if len(parts) == 1 else map("".join, zip(*parts, strict=True))
        if self._comments:
            entries = self._commented(batch, picked, entries)
        before, titled, loose = self._listing.before, self._summary, self._loose(batch)
        for place, entry in zip(self._listing.places(), entries, strict=True):
            above = before(place, titled=titled)
            while loose and loose[0] < place:
                above += self._comment(f"frame {loose[0] + 1}: {self._comments[loose.pop(0)]}")
            yield above + entry
        rest = before(None, titled=titled)
        rest += "".join(self._comment(f"frame {at + 1}: {self._comments[at]}") for at in loose)
        if rest:
            yield rest

    def _commented(self, batch: Batch, picked: ListedRows, entries: Iterator[str]) -> Iterator[str]:
        """Give the lines of each transfer, and below them what somebody wrote about its frames."""
        frames = batch.transfers.column("frame")
        ends = np.asarray(frames.offsets).astype(np.int64)
        places = numbers(frames.values)[ends[0] : ends[-1]].astype(np.int64) if len(ends) else np.zeros(0, np.int64)
        said: dict[int, list[str]] = {}
        for at in np.flatnonzero(np.isin(places, list(self._comments))).tolist():
            row = int(np.searchsorted(ends - ends[0], at, "right")) - 1
            said.setdefault(row, []).append(self._comments[int(places[at])])
        for row, entry in zip(picked.transfers.tolist(), entries, strict=True):
            yield entry + "".join(map(self._comment, said.get(row, ())))

    def _loose(self, batch: Batch) -> list[int]:
        """Return the frames with a comment that form no transfer, from 0, ascending."""
        first, verdicts = batch.first_frame, batch.frames.column("verdict")
        inside = sorted(at for at in self._comments if first <= at < first + len(verdicts))
        return [at for at in inside if verdicts[at - first].as_py() != _USED]

    def _comment(self, text: str) -> str:
        return self._palette.paint("good", comment_line(text)) + "\n"

    def end(self) -> str:
        """Give the sums of foreign frames."""
        return self._listing.end(titled=self._summary)


class FieldLines:
    """Chosen fields, and the frames that some of them have to look at."""

    def __init__(self, names: Sequence[str], registry: Registry, zero: int | None, numbering: Numbering) -> None:
        self._frames = FrameWindow()
        self._fields = Fields(registry, names, self._frames, zero, numbering=numbering)
        self.begin, self.end = self._fields.begin, self._fields.end

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Give a line for each picked transfer."""
        self._frames.feed(batch)
        return self._fields.rows(batch, picked)


def writer(
    options: WriterOptions,
    registry: Registry,
    zero: int | None,
    numbering: Numbering | None = None,
    named: NamedFrames | None = None,
    matcher: FrameMatcher | None = None,
) -> Writer:
    """Return the view that is asked for; `zero` is the time that counts as 0.

    `numbering` has to know the frames of a batch before the view is given it. Rows are marked with the rules that are
    `named`; of a list of frames `matcher` chooses some.

    Raises `LookupError` for unknown names, `ValueError` for a form that does not mark rows and for wrong colour rules.
    """
    numbering = numbering or Numbering()
    if options.fields and options.form in BY_NAME:
        from analyzer.views.chosen import ChosenRecords  # noqa: PLC0415 - most records have their own keys
        from analyzer.views.fields import texts_among  # noqa: PLC0415

        lines = writer(replace(options, form="fields"), registry, zero, numbering, named, matcher)
        return ChosenRecords(lines, options.fields, options.form, set(texts_among(registry, options.fields)))
    if options.frame_list:
        return _frame_list(options, registry, zero, numbering, named, matcher)
    if options.form in BY_NAME:
        return BY_NAME[options.form].writer(registry, named, derived=options.derived)
    if options.form == "fields":
        if named is not None:
            raise ValueError("-T fields does not mark rows with --findings")
        return FieldLines(options.fields, registry, zero, numbering)
    return Text(options, registry, _clock(options, zero), numbering, named)


def _frame_list(
    options: WriterOptions, registry: Registry, zero: int | None, numbering: Numbering, named: NamedFrames | None,
    matcher: FrameMatcher | None,
) -> Writer:  # fmt: skip
    from analyzer.views.frames.fields import FrameFields  # noqa: PLC0415 - few lists are of frames
    from analyzer.views.frames.rows import FrameRows  # noqa: PLC0415
    from analyzer.views.frames.writers import FrameLines, FrameRecords  # noqa: PLC0415

    painter = _painter(options, registry, frame_list=True) if options.form == "text" else None
    rows = FrameRows(
        registry, numbering, wait=not options.follow, most=options.count, named=named, matcher=matcher, painter=painter
    )  # fmt: skip
    if options.form == "fields":
        return FrameFields(rows, options.fields, zero, registry, numbering)
    if options.form in BY_NAME:
        return FrameRecords(rows, options.form)
    palette, codes = Palette(True) if options.colour else PLAIN, () if painter is None else painter.codes
    return FrameLines(rows, _clock(options, zero), palette, _width(), codes=codes, comments=options.comments)


def _painter(options: WriterOptions, registry: Registry, *, frame_list: bool = False) -> Painter | None:
    """Return what finds the colours of rows; a file that is asked for is checked in any case."""
    if not options.colour and options.colours is None:
        return None
    from analyzer.views.colours.painter import Painter  # noqa: PLC0415 - most lists go into files and pipes
    from analyzer.views.colours.rules import colour_rules  # noqa: PLC0415

    rules = colour_rules(options.colours, registry)
    return Painter(rules, frame_list=frame_list) if rules and options.colour else None


def _clock(options: WriterOptions, zero: int | None) -> TimeFormat:
    clock = TimeFormat(options.time, zero)
    clock.signed = options.signed
    return clock


def _width() -> int | None:
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None
