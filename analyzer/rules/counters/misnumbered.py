"""A first frame with a wrong transfer ID: by the CRC the frames behind it belong to it, and say which ID was meant."""

from __future__ import annotations

from binascii import crc_hqx
from typing import TYPE_CHECKING

from analyzer.rules.frames.foreign import session_of
from analyzer.tables import TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE
from dissectors.kit import SESSION
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

_NEAR = 512  # frames that are looked through
_SOURCE = 0xFF  # bits of an identifier that all sessions of a sender have in common


def meant(view: View, number: int, code: int) -> int | None:
    """Return the transfer ID of the frames behind a first frame of a type, if it is another one and they fit."""
    kept = view.frame(number)
    if kept is None or not kept.data or kept.data[-1] & (TAIL_START | TAIL_END) != TAIL_START:
        return None
    own, parts = kept.data[-1] & TAIL_ID, [kept.data]
    for _, data in _session(view, number, behind=True):
        tail = data[-1]
        if tail & TAIL_START or not (tail ^ parts[-1][-1]) & TAIL_TOGGLE or tail & TAIL_ID == own:
            return None
        parts.append(data)
        if tail & TAIL_END:
            break
    whole = parts[-1][-1] & TAIL_END and len({data[-1] & TAIL_ID for data in parts[1:]}) == 1
    return parts[-1][-1] & TAIL_ID if whole and _fits(view, code, b"".join(data[:-1] for data in parts)) else None


def _fits(view: View, code: int, joined: bytes) -> bool:
    """Return whether the bytes of a transfer of a type begin with the right CRC."""
    wire, payload = int.from_bytes(joined[:2], "little"), joined[2:]
    starts = map(crc_start, view.types.signatures(code))
    return len(joined) > 1 and any(crc_hqx(payload, start) == wire for start in starts)


def meant_before(view: View, number: int, code: int) -> int | None:
    """Return the same of the last first frame before another one."""
    before = _session(view, number, behind=False)
    first = next((one for one, data in before if data[-1] & TAIL_START), None)
    return None if first is None else meant(view, first, code)


def _session(view: View, like: int, *, behind: bool) -> Iterator[tuple[int, bytes]]:
    """Yield frames of the session of one, those behind it or those before it, the nearest first."""
    wanted = view.frame(like)
    if wanted is None:
        return
    session = session_of(wanted.id, wanted.verdict)
    mask = SESSION if wanted.id & _SOURCE else _SOURCE  # those of anonymous senders differ in more than that
    near = wanted.bus, wanted.id & mask, mask
    for number in (
        view.numbers_between(like + 1, like + 1 + _NEAR, *near) if behind else view.numbers_before(like, _NEAR, *near)
    ):
        kept = view.frame(number)
        if kept is not None and kept.data and session_of(kept.id, kept.verdict) == session:
            yield number, kept.data
