"""A first frame with a wrong transfer ID: by the CRC the frames behind it belong to it, and say which ID was meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.diagnosis.neighbours import part_of
from analyzer.rules.diagnosis.proofs import KnownType
from analyzer.rules.frames.foreign import session_of
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.diagnosis.proofs import Part
    from dissectors.kit import View

_NEAR = 512  # frames that are looked through


def meant(view: View, number: int, code: int) -> int | None:
    """Return the transfer ID of the frames behind a first frame of a type, if it is another one and they fit."""
    first = part_of(number, view.frame(number))
    if first is None or not first.start or first.end:
        return None
    parts = [first]
    for part in _session(view, number, range(number + 1, number + 1 + _NEAR)):
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
    before = _session(view, number, range(number - 1, max(-1, number - 1 - _NEAR), -1))
    first = next((part.number for part in before if part.start), None)
    return None if first is None else meant(view, first, code)


def _session(view: View, like: int, numbers: range) -> Iterator[Part]:
    """Yield frames of the session of one."""
    wanted = view.frame(like)
    for number in numbers:
        kept = view.frame(number)
        if kept is None or wanted is None:
            return
        part = part_of(number, kept)
        same = session_of(kept.id, kept.verdict) == session_of(wanted.id, wanted.verdict)
        if part is not None and kept.bus == wanted.bus and same:
            yield part
