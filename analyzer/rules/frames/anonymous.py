"""Messages without a sender: anonymous ones and their discriminators, and those of senders that have no node ID."""

from __future__ import annotations

from binascii import crc_hqx
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import EXTENDED, KINDS, VERDICTS
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View

_ANONYMOUS, _MESSAGE = KINDS.index("anonymous"), KINDS.index("message")
_USED = VERDICTS.index("used")
_START = 0xFFFF  # of the CRC that libcanard draws its discriminators from
_WINDOWS = range(3)  # positions of 14 bits in 16
MOST_IDENTIFIERS = 4096


class Anonymous(Rule):
    """Messages without a sender. Remembers the identifiers of the last 4096, for those that are believed late."""

    rules = ("CAN-008", "CAN-009", "CAN-010")

    def __init__(self) -> None:
        self._identifiers: dict[int, int] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Find valid transfers; frames that are none are `malformed`."""
        self._remember(view)
        t = view.transfers
        nameless = np.flatnonzero((t.kind == _MESSAGE) & (t.src == 0))
        if len(nameless):
            yield view.among_transfers("CAN-009", nameless, lambda row: {"what": _form(view, row)})
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
    """Return the random part of an anonymous identifier, bits 23 to 10 (4.1.2)."""
    return identifier >> 10 & 0x3FFF


def _form(view: View, row: int) -> str:
    frames = len(view.transfers.frames(row))
    return f"{frames} frame{'s' * (frames > 1)} of type {int(view.transfers.type_id[row])}"


def _from_crc(values: Values) -> bool:
    return any(values["crc_here"] >> low & 0x3FFF == values["discriminator"] for low in _WINDOWS)
