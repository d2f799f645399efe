"""Ways from one row to another: of the same sender, the answer to a request, the next finding or mark."""

from __future__ import annotations

import threading
from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING

import numpy as np

from analyzer.browser.store.order import TRANSFER, split
from analyzer.browser.store.segment import OpenSegment
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import ListRow, TableStore
    from analyzer.browser.view import BrowserView
    from dissectors.kit import Array

_REQUEST, _RESPONSE = KINDS.index("request"), KINDS.index("response")
_PATIENCE = 0.03  # seconds that whoever asks waits, before something else shows that it is looked for
Target = tuple[int, int] | None
Wanted = dict[str, int]


class Walk:
    """Looks for the nearest transfer with some values behind a row, or before it, in a thread of its own.

    Args:
        store: what is there.
        start: segment and place in its list of the row.
        step: 1 for what is behind it, -1 for what is before.
        wanted: values of columns of the transfer.
        otherwise: what is to be said if there is none.
    """

    def __init__(self, store: TableStore, start: tuple[int, int], step: int, wanted: Wanted, otherwise: str) -> None:
        self._store, self._start, self._step, self._wanted = store, start, step, wanted
        self._stop = threading.Event()
        self.otherwise = otherwise
        self.target: Target = None
        self.done = False

    def begin(self) -> None:
        """Begin to look; what is near is found when this is back."""
        thread = threading.Thread(target=self._work, name="walk", daemon=True)
        thread.start()
        thread.join(_PATIENCE)

    def stop(self) -> None:
        """Look no further."""
        self._stop.set()

    def _work(self) -> None:
        segment, local = self._start
        last = len(self._store.segments) if self._step > 0 else -1
        try:
            for at in range(segment, last, self._step):
                if self._stop.is_set():
                    return
                found = _matching(self._store, at, self._wanted)
                if at == segment:
                    found = found[found > local] if self._step > 0 else found[found < local]
                if len(found):
                    self.target = at, int(found[0] if self._step > 0 else found[-1])
                    return
        finally:
            self.done = True


def _matching(store: TableStore, at: int, wanted: Wanted) -> Array:
    """Return the places in the list of a segment of transfers with these values, ascending."""
    if not store.segments[at].transfers:
        return np.zeros(0, np.int64)
    opened = OpenSegment(store.segments[at])
    holds: Array = np.ones(store.segments[at].transfers, bool)
    for name, value in wanted.items():
        holds &= opened.column("transfers", name) == value
    # Transfers are not in the order of the list: some wait until it is known what they are.
    kinds, entries = split(opened.column("rows", "key"))
    listed = kinds == TRANSFER
    listed[listed] = holds[entries[listed]]
    return np.flatnonzero(listed)


def sender_before(view: BrowserView, row: ListRow) -> Target:
    """Return the transfer before of the same sender and type."""
    before = int(view.store.opened(row.segment).column("before", "before")[row.entry])
    at = None if before < 0 else view.store.segment_of_transfer(before)
    if at is None:
        return None
    local = view.store.local_of(at, TRANSFER, before - view.store.segments[at].first_transfer)
    return None if local is None else (at, local)


def same_sender(view: BrowserView, own: Wanted) -> Wanted:
    """Return what transfers of the same sender and type have in common."""
    names = ("bus", "kind", "type_id", "src", *(("dst",) if view.is_service(own) else ()))
    return {name: own[name] for name in names}


def same_type(own: Wanted) -> Wanted:
    """Return what transfers of the same type have in common, whoever sent them."""
    return {name: own[name] for name in ("kind", "type_id")}


def counterpart(own: Wanted) -> Wanted:
    """Return what tells the response to a request, or the request of a response."""
    asked = own["kind"] == _REQUEST
    return {
        "bus": own["bus"], "kind": _RESPONSE if asked else _REQUEST, "type_id": own["type_id"], "src": own["dst"],
        "dst": own["src"], "transfer_id": own["transfer_id"],
    }  # fmt: skip


def next_place(places: Sequence[int], now: int, step: int) -> int | None:
    """Return the next of some ascending places behind one, or before it."""
    if step > 0:
        k = bisect_right(places, now)
        return places[k] if k < len(places) else None
    k = bisect_left(places, now) - 1
    return places[k] if k >= 0 else None


def follow_filter(view: BrowserView, row: ListRow, what: str) -> str:
    """Return the filter of a conversation that a row is part of, empty if it is of none.

    `what` is node, type, esc (the channel), unit or exchange (of a service).
    """
    own = view.sender(row)
    if own is None:
        return ""
    name = view.type_name(own)
    if what == "node":
        return f"node == {own['src']}"
    if what == "type":
        return f"{name} && dronecan.src == {own['src']}" if name else f"dronecan.type_id == {own['type_id']}"
    if what == "exchange":
        if not view.is_service(own):
            return ""
        first, second = own["src"], own["dst"]
        both = f"node == {first} && node == {second}"
        return f"{name} && {both}" if name else f"dronecan.type_id == {own['type_id']} && {both}"
    return _numbered(view, row, what)


def _numbered(view: BrowserView, row: ListRow, what: str) -> str:
    """Return the filter of the channel or power unit that the details of a row name."""
    field = "channel" if what == "esc" else "unit"
    for line in view.shown(row).lines:
        if line.name.rpartition(".")[2] == field and line.value.split(" ")[0].isdigit():
            return f"{'ch' if what == 'esc' else 'unit'} == {line.value.split(' ')[0]}"
    return ""
