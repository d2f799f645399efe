"""Texts that frames have from their transfers: texts, for each frame until the last one is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.facts.identifiers import NOBODY, who
from analyzer.tables import KINDS
from analyzer.views.fields import Fields
from analyzer.window.first_frames import first_frames
from dissectors.kit.cells import numbers, pylist

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.rows import FrameRows
    from analyzer.window.numbering import Numbering
    from dissectors import Registry

_REQUEST = KINDS.index("request")
_BY_IDENTIFIER = ("dronecan.src", "dronecan.dst")  # which frames without a transfer have, too


class OwnerFields:
    """Chosen fields of transfers, frame by frame. Raises `ValueError` for one that does not exist.

    Args:
        registry: the types.
        names: fields of transfers.
        numbering: of frames.
    """

    def __init__(self, registry: Registry, names: Sequence[str], numbering: Numbering) -> None:
        self.names = tuple(names)
        self._fields = Fields(registry, names, lambda _: None)
        self._numbering = numbering
        self._known: dict[int, list[str]] = {}  # by the number of the first frame
        self._ends: list[tuple[int, int]] = []  # last place and that number, of those that are known

    def feed(self, batch: Batch) -> None:
        """Take the transfers that end in a batch."""
        if not self.names or not len(batch.transfers):
            return
        first = self._numbering.of_all(first_frames(batch.transfers)).tolist()
        texts = self._fields.rows(batch)
        self._known.update(zip(first, (text[:-1].split("\t") for text in texts), strict=True))
        frames = pylist(batch.transfers.column("frame"))
        self._ends += [(max(some, default=-1), number) for some, number in zip(frames, first, strict=True)]

    def forget(self, rows: FrameRows) -> None:
        """Forget the transfers of frames that have been given."""
        oldest = rows.oldest
        kept = [] if oldest is None else [one for one in self._ends if one[0] >= oldest]
        if len(kept) < len(self._ends):
            self._known = {number: self._known[number] for _, number in kept}
            self._ends = kept

    def columns(self, rows: pa.RecordBatch) -> dict[str, pa.Array]:
        """Return the texts of each field, a cell for each frame; null for what has none."""
        if not self.names:
            return {}
        nothing: list[str | None] = [None] * len(self.names)
        cells = [self._known.get(number, nothing) for number in rows.column("transfer").to_pylist()]
        found = dict(zip(self.names, map(list, zip(*cells, strict=True)), strict=True))
        for name in self.names:
            if name in _BY_IDENTIFIER:
                by_identifier = _by_identifier(rows, name)
                found[name] = [a if a is not None else b for a, b in zip(found[name], by_identifier, strict=True)]
        return {name: pa.array(texts, pa.string()) for name, texts in found.items()}


def _by_identifier(rows: pa.RecordBatch, name: str) -> list[str | None]:
    identifier = numbers(rows.column("id")).astype(np.int64)
    node, code = who(identifier, numbers(rows.column("flags")), numbers(rows.column("verdict")))
    if name == "dronecan.dst":
        node = np.where((node != NOBODY) & (code >> 16 >= _REQUEST), identifier >> 8 & 0x7F, NOBODY)
    return [None if one == NOBODY else str(one) for one in node.tolist()]
