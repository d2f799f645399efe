"""Puts the views together as the options ask: what is written for each batch."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer.views.fields import Fields
from analyzer.views.formats import BY_NAME
from analyzer.views.frames import FrameWindow
from analyzer.views.hexdump import hexdump
from analyzer.views.listing import Listing
from analyzer.views.rows import TransferRows
from analyzer.views.terminal import PLAIN, Palette
from analyzer.views.times import TimeFormat
from analyzer.views.tree import Tree

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.formats import Writer
    from dissectors import Registry
    from dissectors.kit import Array


@dataclass(frozen=True, slots=True)
class WriterOptions:
    """A view as somebody asks for it.

    `form` is text, fields, json, jsonl or csv. Of a text: `time` is the form of times as tshark has it, `signed` says
    that some are before zero, `only` names the types that are shown in detail, `dumps` asks for the bytes.
    """

    form: str = "text"
    fields: tuple[str, ...] = ()
    time: str = "r"
    details: bool = False
    only: tuple[str, ...] | None = None
    summary: bool = False
    dumps: bool = False
    signed: bool = False
    colour: bool = False


class Text:
    """The list, the details and the bytes of each transfer, as far as they are asked for."""

    def __init__(self, options: WriterOptions, registry: Registry, clock: TimeFormat) -> None:
        self._details, self._bytes = options.details or options.only is not None, options.dumps
        self._summary = options.summary or not self._details
        self._palette = Palette(True) if options.colour else PLAIN
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        only = [registry.resolve(name).table for name in options.only or ()]
        self._registry = registry
        self._listing = Listing(registry, clock, self._palette, width)
        self._tree = Tree(registry, clock, self._palette, only)
        self._frames = FrameWindow()

    def begin(self) -> str:
        """Nothing: the header comes with the first transfer, which settles its widths."""
        return ""

    def rows(self, batch: Batch, picked: Array) -> Iterator[str]:
        """Give the lines of each transfer together, in a list also of error frames and losses among them."""
        self._frames.feed(batch)
        parts: list[Iterator[list[str]]] = []
        if self._summary:
            parts.append(self._listing.entries(batch, picked))
        if self._details:
            parts.append(self._tree.details(batch, picked))
        if self._bytes:
            parts.append(self._dumps(batch, picked))
        for entry in zip(*parts, strict=True):
            yield "".join(f"{line}\n" for lines in entry for line in lines)
        if self._summary and (rest := self._listing.rest()):
            yield "".join(f"{line}\n" for line in rest)

    def end(self) -> str:
        """Nothing."""
        return ""

    def _dumps(self, batch: Batch, picked: Array) -> Iterator[list[str]]:
        rows = TransferRows(batch, self._registry, picked)
        for frames, whole, bare in zip(rows.column("frame"), rows.column("payload"), rows.unpadded(), strict=True):
            yield list(hexdump(frames, self._frames, len(whole) - len(bare), self._palette))


class FieldLines:
    """Chosen fields, and the frames that some of them have to look at."""

    def __init__(self, names: Sequence[str], registry: Registry, zero: int | None) -> None:
        self._frames = FrameWindow()
        self._fields = Fields(registry, names, self._frames, zero)
        self.begin, self.end = self._fields.begin, self._fields.end

    def rows(self, batch: Batch, picked: Array) -> Iterator[str]:
        """Give a line for each picked transfer."""
        self._frames.feed(batch)
        return self._fields.rows(batch, picked)


def writer(options: WriterOptions, registry: Registry, zero: int | None) -> Writer:
    """Return the view that is asked for; `zero` is the time that counts as 0.

    Raises `LookupError` for unknown names.
    """
    if options.form in BY_NAME:
        return BY_NAME[options.form].writer(registry)
    if options.form == "fields":
        return FieldLines(options.fields, registry, zero)
    clock = TimeFormat(options.time, zero)
    clock.signed = options.signed
    return Text(options, registry, clock)
