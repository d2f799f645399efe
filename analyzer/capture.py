"""A capture as Python sees it: batches of Arrow tables, or one whole table by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

import dissectors
from analyzer.engine import Engine
from analyzer.sources import Source

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from os import PathLike
    from pathlib import Path

    from analyzer.engine import Batch, Totals


class Capture:
    """One file, decoded on the way through. Iterating gives `Batch` after `Batch`; each iteration reads it anew.

    Args:
        path: candump text in any dialect, gzip or not; `-` is standard input.
        dissectors: folders with further data types, before the built-in ones.

    Raises:
        CaptureError: the file cannot be read. Damage behind readable content is in `damage` instead.
    """

    def __init__(self, path: str | PathLike[str], dissectors_: Sequence[Path] = ()) -> None:
        self.path = str(path)
        self.registry = dissectors.load(dissectors_)
        self.source = Source(self.path)
        self.engine = Engine(self.registry)

    def __iter__(self) -> Iterator[Batch]:
        """Batches in capture order."""
        self.source = Source(self.path)
        self.engine = Engine(self.registry)
        yield from self.engine.run(self.source.chunks())

    def table(self, name: str) -> pa.Table:
        """All rows of one table: `frames`, `transfers`, `events`, a message type or a packet (`PUSHCAN.MotorStatus`).

        Raises `LookupError` for a name that no type has; a known type that does not occur gives no rows.
        """
        if name in ("frames", "transfers", "events"):
            return pa.Table.from_batches([getattr(batch, name) for batch in self])
        wanted = name if self._is_packet(name) else self.registry.resolve(name).table
        pieces = [batch.messages[wanted] for batch in self if wanted in batch.messages]
        return pa.Table.from_batches(pieces) if pieces else pa.table({})

    def _is_packet(self, name: str) -> bool:
        message, _, packet = name.rpartition(".")
        try:
            family = self.registry.resolve(message).packets if message else None
        except LookupError:
            return False
        return family is not None and (packet == "unrecognized" or packet in {p.name for p in family.packets})

    @property
    def totals(self) -> Totals:
        """What became of every line and frame read so far."""
        return self.engine.totals

    @property
    def buses(self) -> tuple[str, ...]:
        """Interface names by the index in the `bus` columns."""
        return self.engine.buses


def open_capture(path: str | PathLike[str], dissectors: Sequence[Path] = ()) -> Capture:
    """Opens a capture; nothing is read before the first batch or table is asked for."""
    return Capture(path, dissectors)
