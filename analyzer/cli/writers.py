"""Puts the views together as the options ask: what is written for each batch."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING, Any, Protocol

from analyzer.cli import options
from analyzer.views.fields import Fields
from analyzer.views.frames import FrameWindow
from analyzer.views.hexdump import hexdump
from analyzer.views.listing import Listing
from analyzer.views.records import Csv, JsonArray, JsonLines
from analyzer.views.rows import Rows
from analyzer.views.terminal import PLAIN, Palette
from analyzer.views.times import Clock
from analyzer.views.tree import Tree

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    import numpy.typing as npt

    from analyzer.engine import Batch
    from dissectors import Registry

    Picked = npt.NDArray[Any]


class Writer(Protocol):
    """A view over a whole capture, as text with its line ends."""

    def begin(self) -> str:
        """What stands before everything."""

    def rows(self, batch: Batch, picked: Picked) -> Iterator[str]:
        """What the picked transfers of one batch say, then what stands behind them."""

    def end(self) -> str:
        """What stands after everything."""


class Text:
    """The list, the details and the bytes of each transfer, as far as they are asked for."""

    def __init__(self, args: argparse.Namespace, registry: Registry, clock: Clock) -> None:
        self._details, self._bytes = args.details or args.only is not None, args.bytes
        self._summary = args.summary or not self._details
        self._palette = Palette(True) if options.colour(args) else PLAIN
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        only = [registry.resolve(name).table for name in (args.only or "").split(",") if name]
        self._registry = registry
        self._listing = Listing(registry, clock, self._palette, width)
        self._tree = Tree(registry, clock, self._palette, only)
        self._frames = FrameWindow()

    def begin(self) -> str:
        """Nothing: the header comes with the first transfer, which settles its widths."""
        return ""

    def rows(self, batch: Batch, picked: Picked) -> Iterator[str]:
        """The lines of each transfer together, in a list also of error frames and losses among them."""
        self._frames.add(batch)
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

    def _dumps(self, batch: Batch, picked: Picked) -> Iterator[list[str]]:
        rows = Rows(batch, self._registry, picked)
        for frames, whole, bare in zip(rows.column("frame"), rows.column("payload"), rows.unpadded(), strict=True):
            yield list(hexdump(frames, self._frames, len(whole) - len(bare), self._palette))


class FieldLines:
    """Chosen fields, and the frames that some of them have to look at."""

    def __init__(self, names: list[str], registry: Registry, zero: int | None) -> None:
        self._frames = FrameWindow()
        self._fields = Fields(registry, names, self._frames, zero)
        self.begin, self.end = self._fields.begin, self._fields.end

    def rows(self, batch: Batch, picked: Picked) -> Iterator[str]:
        """A line for each picked transfer."""
        self._frames.add(batch)
        return self._fields.rows(batch, picked)


def writer(args: argparse.Namespace, registry: Registry, zero: int | None) -> Writer:
    """The view that the options name; `zero` is the time that counts as 0. Raises `LookupError` for unknown names."""
    if args.form == "jsonl":
        return JsonLines(registry)
    if args.form == "json":
        return JsonArray(registry)
    if args.form == "csv":
        return Csv(registry)
    if args.form == "fields":
        return FieldLines(args.fields, registry, zero)
    clock = Clock(args.time, zero)
    clock.signed = args.around is not None
    return Text(args, registry, clock)
