"""What single frames and the identifiers of transfers show: form, addresses, anonymous senders, priority."""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.view import who
from analyzer.tables import EXTENDED, FRAME_ANOMALIES, KINDS, TRANSFER_ANOMALIES, VERDICTS
from dissectors.conformance import Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.conformance import Found, Values, View, Words

_IMPOSSIBLE = 1 << FRAME_ANOMALIES.index("impossible length")
_ANONYMOUS = KINDS.index("anonymous")
_USED = VERDICTS.index("used")
_START = 0xFFFF  # of the CRC that libcanard draws its discriminators from
_WINDOWS = range(3)  # positions of 14 bits in 16
MOST_IDENTIFIERS = 4096
GONE = "?"  # in place of what stood in a frame that is too long ago


@watches("CAN-001")
def narrow(view: View) -> Iterator[Found]:
    """Identifiers of 11 bits."""
    f = view.frames
    if not len(f) or np.bitwise_and.reduce(f.flags) & EXTENDED:
        return
    rows = np.flatnonzero(f.flags & EXTENDED == 0)

    def values(row: int) -> Values:
        return {"can_id": int(f.id[row]), "length": int(f.length[row])}

    yield view.among_frames("CAN-001", rows, values, key=f.id[rows])


@watches("CAN-019")
def impossible(view: View) -> Iterator[Found]:
    """Lengths that no controller sends, whoever's the frame is."""
    f = view.frames
    rows = flagged(f.anomaly, _IMPOSSIBLE)
    if len(rows):
        found = view.among_frames("CAN-019", rows, lambda row: {"length": int(f.length[row])})
        node, code = who(f.id[rows], f.flags[rows], np.zeros(len(rows), np.uint8))
        yield replace(found, node=node, type=code)


@watches("CAN-003", "CAN-006", "CAN-007", "CAN-012", "CAN-014")
def addressed(view: View) -> Iterator[Found]:
    """Transfers with an identifier that none may have, with two of them, or in CAN FD frames."""
    t = view.transfers
    for rule, bit, values in _BITS:
        rows = flagged(t.anomaly, 1 << TRANSFER_ANOMALIES.index(bit))
        if len(rows):
            yield view.among_transfers(rule, rows, partial(values, view))
    if t.fd.any():
        yield view.among_transfers("CAN-003", np.flatnonzero(t.fd), lambda row: {"length": _fd_length(view, row)})


class Anonymous(Watcher):
    """Messages without a sender. Remembers the identifiers of the last 4096, for those that are believed late."""

    rules = ("CAN-008", "CAN-010")

    def __init__(self) -> None:
        self._identifiers: dict[int, int] = {}

    def look(self, view: View) -> Iterator[Found]:
        """Frames that are no valid transfer are `leftovers`."""
        self._remember(view)
        t = view.transfers
        rows = np.flatnonzero(t.kind == _ANONYMOUS)
        if not len(rows):
            return
        random = {row: self._discriminator(view, int(t.lead[row])) for row in rows.tolist()}
        seen = np.array([row for row, value in random.items() if value is not None], np.int64)

        def values(row: int) -> Values:
            return {"discriminator": random[row], "type_id": int(t.type_id[row])}

        yield view.among_transfers("CAN-008", seen, values)

        def drawn(row: int) -> Values:
            return {"discriminator": random[row], "crc_here": crc_hqx(t.payload(row), _START)}

        odd = [row for row in seen.tolist() if not _from_crc(drawn(row))]
        yield view.among_transfers("CAN-010", np.array(odd, np.int64), drawn)

    def _remember(self, view: View) -> None:
        f = view.frames
        rows = np.flatnonzero(f.id & 0xFF == 0)
        if len(rows):
            ours = (f.flags[rows] & EXTENDED != 0) & (f.verdict[rows] == _USED)
            rows = rows[ours][-MOST_IDENTIFIERS:]
            self._identifiers.update(zip((rows + f.first).tolist(), f.id[rows].tolist(), strict=True))
            for number in list(self._identifiers)[: max(0, len(self._identifiers) - MOST_IDENTIFIERS)]:
                del self._identifiers[number]

    def _discriminator(self, view: View, number: int) -> int | None:
        identifier = self._identifiers.get(number)
        if identifier is None:
            kept = view.frame(number)
            identifier = None if kept is None else kept.id
        return None if identifier is None else discriminator(identifier)


def discriminator(identifier: int) -> int:
    """The random part of an anonymous identifier, bits 23 to 10 (4.1.2)."""
    return identifier >> 10 & 0x3FFF


def flagged(anomaly: Words, bits: int) -> Words:
    """Rows that have one of the bits; costs next to nothing if none has."""
    if not int(np.bitwise_or.reduce(anomaly)) & bits:
        return np.empty(0, np.int64)
    return np.flatnonzero(anomaly & anomaly.dtype.type(bits))


def _from_crc(values: Values) -> bool:
    return any(values["crc_here"] >> low & 0x3FFF == values["discriminator"] for low in _WINDOWS)


def _service(view: View, row: int) -> Values:
    t = view.transfers
    return {"type_id": int(t.type_id[row]), "dst": int(t.dst[row]), "node": int(t.src[row])}


def _priorities(view: View, row: int) -> Values:
    kept = [view.frame(number) for number in view.transfers.frames(row)]
    first = int(view.transfers.priority[row])
    other = (frame.id >> 24 for frame in kept if frame is not None and frame.id >> 24 != first)
    return {"first_priority": first, "priority": next(other, GONE)}


def _fd_length(view: View, row: int) -> Any:
    kept = view.frame(int(view.transfers.lead[row]))
    return GONE if kept is None else len(kept.data)


_BITS: tuple[tuple[str, str, Callable[[View, int], Values]], ...] = (
    ("CAN-006", "destination zero", _service),
    ("CAN-007", "source zero", _service),
    ("CAN-012", "addressed to itself", _service),
    ("CAN-014", "priority changed", _priorities),
)

WATCHERS: tuple[type[Watcher], ...] = (narrow, impossible, addressed, Anonymous)
