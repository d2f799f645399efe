"""Ways from one row to another: of the same sender, the answer to a request, the next finding or mark."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING

import numpy as np

from analyzer.browser.store.order import TRANSFER, split
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import Row
    from analyzer.browser.view import BrowserView
    from dissectors.kit import Array

_REQUEST, _RESPONSE = KINDS.index("request"), KINDS.index("response")
_MOST_SEGMENTS = 10_000
Target = tuple[int, int] | None


def same_sender(view: BrowserView, row: Row, step: int) -> Target:
    """Return the next transfer, or the one before, of the same sender and type."""
    own = view.sender(row)
    if own is None:
        return None
    if step < 0:
        before = int(view.store.opened(row.segment).column("before", "before")[row.entry])
        at = None if before < 0 else view.store.segment_of_transfer(before)
        if at is None:
            return None
        index = before - view.store.segments[at].first_transfer
        local = view.store.local_of(at, TRANSFER, index)
        return None if local is None else (at, local)
    wanted = {name: own[name] for name in ("bus", "kind", "type_id", "src")}
    if view.is_service(own):
        wanted["dst"] = own["dst"]
    return _scan(view, row, 1, wanted)


def counterpart(view: BrowserView, row: Row) -> Target:
    """Return the response to a request, the request of a response."""
    own = view.sender(row)
    if own is None or own["kind"] not in (_REQUEST, _RESPONSE):
        return None
    asked = own["kind"] == _REQUEST
    wanted = {
        "bus": own["bus"], "kind": _RESPONSE if asked else _REQUEST, "type_id": own["type_id"], "src": own["dst"],
        "dst": own["src"], "transfer_id": own["transfer_id"],
    }  # fmt: skip
    return _scan(view, row, 1 if asked else -1, wanted)


def _scan(view: BrowserView, row: Row, step: int, wanted: dict[str, int]) -> Target:
    """Return the nearest transfer with these values behind a row, or before it."""
    store = view.store
    last = len(store.segments) if step > 0 else -1
    for at in list(range(row.segment, last, step))[:_MOST_SEGMENTS]:
        opened = store.opened(at)
        if not store.segments[at].transfers:
            continue
        holds: Array = np.ones(store.segments[at].transfers, bool)
        for name, value in wanted.items():
            holds &= opened.column("transfers", name) == value
        # Transfers are not in the order of the list: some wait until it is known what they are.
        kinds, entries = split(opened.column("rows", "key"))
        listed = kinds == TRANSFER
        listed[listed] = holds[entries[listed]]
        found = np.flatnonzero(listed)
        if at == row.segment:
            found = found[found > row.local] if step > 0 else found[found < row.local]
        if len(found):
            return at, int(found[0] if step > 0 else found[-1])
    return None


def next_place(places: Sequence[int], now: int, step: int) -> int | None:
    """Return the next of some ascending places behind one, or before it."""
    if step > 0:
        k = bisect_right(places, now)
        return places[k] if k < len(places) else None
    k = bisect_left(places, now) - 1
    return places[k] if k >= 0 else None


def follow_filter(view: BrowserView, row: Row, what: str) -> str:
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


def _numbered(view: BrowserView, row: Row, what: str) -> str:
    """Return the filter of the channel or power unit that the details of a row name."""
    field = "channel" if what == "esc" else "unit"
    for line in view.shown(row).lines:
        if line.name.rpartition(".")[2] == field and line.value.split(" ")[0].isdigit():
            return f"{'ch' if what == 'esc' else 'unit'} == {line.value.split(' ')[0]}"
    return ""
