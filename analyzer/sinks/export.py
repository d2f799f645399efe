"""Every decoded table of a capture, in the shape that `portable` gives it, to files of one format."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.by_name import example, find_table
from analyzer.sinks import ALL, portable
from analyzer.sinks.late import LateFrames
from analyzer.sinks.tables import Tables
from analyzer.tables import ESC, EVENT_ROWS, FRAMES, TRANSFERS, empty

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping
    from typing import BinaryIO

    import pyarrow as pa

    from analyzer.window.part import BatchPart
    from dissectors import Registry

BASIC = ("frames", "transfers", "events")
FINDINGS = "findings"  # what rules find: written only if it is asked for
HAPPENED = ("flights", "flight_events")  # likewise
ESCS = "esc"  # reports of ESCs beside their commands: likewise


def resolve(registry: Registry, name: str) -> str:
    """Return the table that a person means, or `ALL`. Raises `LookupError`."""
    return name if name in (*BASIC, FINDINGS, *HAPPENED, ESCS, ALL) else find_table(registry, name)[1]


class TableExport:
    """Takes the parts of a capture one after the other.

    Frames, transfers and events have a file even without rows, and so has every table that was asked for by name.

    Args:
        form: a key of `tables.SUFFIXES`.
        make: makes the file of a table.
        registry: the types the capture is decoded with.
        wanted: names of tables as `resolve` gives them; `ALL` if empty.
        folder: where frames wait for their verdicts if these are many.
        about: what is known of the capture, for the metadata of the files.
        threaded: encode in threads of its own what has gathered.
    """

    def __init__(
        self, form: str, make: Callable[[str], BinaryIO], registry: Registry, wanted: Collection[str],
        folder: str | None, about: Mapping[str, str], *, threaded: bool,
    ) -> None:  # fmt: skip
        self._tables = Tables(form, make, about, threaded=threaded)
        self._registry = registry
        self._wanted = wanted
        self._frames = LateFrames(folder) if self._wants("frames") else None
        self._buses: tuple[str, ...] = ()

    def feed(self, part: BatchPart) -> None:
        """Take rows of every table."""
        self._buses = part.buses
        if self._frames is not None:
            self._frames.feed(part.frames, part.frame_rows)
            self._frames.feed_verdicts(part.settled)
            for frames, rows in self._frames.settled(part.settled_before):
                self._tables.feed("frames", portable.frames(frames, rows, part.buses))
        if self._wants("transfers"):
            rows = portable.transfers(part.transfers, part.transfer_rows, part.buses, self._registry)
            self._tables.feed("transfers", rows)
        if self._wants("events"):
            self._tables.feed("events", portable.events(part.events, part.buses))
        for name, table in part.messages.items():
            if self._wants(name):
                self._tables.feed(name, portable.messages(table, part.buses))

    def feed_found(self, name: str, found: pa.RecordBatch) -> None:
        """Take findings, flights or events of these, after the last part."""
        self._tables.feed(name, portable.found(found, self._buses))

    def finish(self) -> Iterator[None]:
        """Write what had to wait for the end, in steps."""
        if self._frames is not None:
            for frames, rows in self._frames.replay():
                self._tables.feed("frames", portable.frames(frames, rows, self._buses))
                yield
        self._complete()
        self._tables.close({"tailbyte.buses": json.dumps(self._buses)})

    def close(self) -> None:
        """Give back what it holds; what is not finished stays unfinished."""
        self._tables.abandon()
        if self._frames is not None:
            self._frames.close()

    @property
    def rows(self) -> dict[str, int]:
        """The tables written, and how many rows each has."""
        return self._tables.rows

    def _complete(self) -> None:
        """Give tables without rows their columns."""
        none = np.zeros(0, np.uint64)
        for name in (BASIC if self._wants(ALL) else ()) + tuple(self._wanted):
            if name in self._tables.rows or name == ALL:
                continue
            if name == "frames":
                rows = portable.frames(empty(FRAMES), none, ())
            elif name == "transfers":
                rows = portable.transfers(empty(TRANSFERS), none, (), self._registry)
            elif name == "events":
                rows = portable.events(empty(EVENT_ROWS), ())
            elif name == ESCS:
                rows = portable.messages(empty(ESC), ())
            else:
                message, _ = find_table(self._registry, name)
                rows = portable.messages(example(self._registry, message)[name].slice(0, 0), ())
            self._tables.feed(name, rows)

    def _wants(self, name: str) -> bool:
        return not self._wanted or ALL in self._wanted or name in self._wanted
