"""Sessions by their transfers: these prove that they are DroneCAN's, and no other protocol's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.bus.heard import Session, service_of
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, TransferTable

_MESSAGE, _REQUEST, _RESPONSE = (KINDS.index(name) for name in ("message", "request", "response"))


def first_transfers(
    t: TransferTable, good: Array | None = None, most: int = 1, *, services: bool = False
) -> Iterator[tuple[Session, int]]:
    """Yield the first rows of each session, at most so many, as they follow each other: messages that are `good`.

    Requests and responses are in sessions, too, if `services` are wanted.
    """
    wanted = t.kind == _MESSAGE
    if services:
        wanted = wanted | (t.kind == _REQUEST) | (t.kind == _RESPONSE)
    rows = np.flatnonzero(wanted if good is None else wanted & good)
    kind, type_id = t.kind[rows], t.type_id[rows].astype(np.int64)
    if services:
        asked = service_of(type_id, t.dst[rows].astype(np.int64), asks=kind == _REQUEST)
        type_id = np.where(kind == _MESSAGE, type_id, asked)
    key = t.bus[rows].astype(np.int64) << 40 | t.src[rows].astype(np.int64) << 32 | type_id
    order = np.argsort(key, kind="stable")
    place = np.arange(len(rows))
    begins = np.maximum.accumulate(np.where(np.diff(key[order], prepend=-1) != 0, place, 0))
    for at in np.sort(order[place - begins < most]).tolist():
        one = int(key[at])
        yield Session(one >> 40, one >> 32 & 0xFF, one & 0xFFFFFFFF), int(rows[at])
