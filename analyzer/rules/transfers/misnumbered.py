"""A first frame with a wrong transfer ID: by the CRC the frames behind it belong to it, and say which ID was meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.diagnosis.neighbours import part_of
from analyzer.rules.diagnosis.proofs import KnownType
from analyzer.rules.frames.foreign import session_of
from dissectors.kit import SESSION
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.diagnosis.proofs import Part
    from dissectors.kit import View

_NEAR = 512  # frames that are looked through
_SOURCE = 0xFF  # bits of an identifier that all sessions of a sender have in common


def meant(view: View, number: int, code: int) -> int | None:
    """Return the transfer ID of the frames behind a first frame of a type, if it is another one and they fit."""
    first = part_of(number, view.frame(number))
    if first is None or not first.start or first.end:
        return None
    parts = [first]
    for part in _session(view, number, behind=True):
        if part.start or part.toggle == parts[-1].toggle or part.transfer_id == first.transfer_id:
            return None
        parts.append(part)
        if part.end:
            break
    starts = [crc_start(signature) for signature in view.types.signatures(code)]
    whole = len({part.transfer_id for part in parts[1:]}) == 1 and KnownType(starts, None).fits(parts)
    return parts[-1].transfer_id if whole else None


def meant_before(view: View, number: int, code: int) -> int | None:
    """Return the same of the last first frame before another one."""
    before = _session(view, number, behind=False)
    first = next((part.number for part in before if part.start), None)
    return None if first is None else meant(view, first, code)


def _session(view: View, like: int, *, behind: bool) -> Iterator[Part]:
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
        part = part_of(number, kept)
        if kept is not None and part is not None and session_of(kept.id, kept.verdict) == session:
            yield part
