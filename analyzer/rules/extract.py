"""The smallest piece of a capture that still shows a finding: windows around its first evidence, each judged anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer._native import Writer
from analyzer.cut import rows_inside, slices
from analyzer.engine import Engine
from analyzer.rules.judge import Judge
from analyzer.rules.settings import Settings
from analyzer.window import Window
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer._native import Piece
    from analyzer.cut import Slice
    from dissectors import Registry

# Time before and after the evidence, tried in this order; None is the whole capture.
REACHES = (0, 50 * MILLISECOND, 500 * MILLISECOND, 2500 * MILLISECOND, 12 * SECOND, 70 * SECOND, None)
MOST_BYTES = 64 * 1024 * 1024  # of one piece
TOGETHER = 16  # pieces collected in one reading of the capture


@dataclass(frozen=True, slots=True)
class Wanted:
    """A finding: what it is about, and where its first occurrence is; frames count from 1, `NO_TIME` is no time."""

    rule: str
    severity: str
    bus: str
    node: int | None
    type: str
    frames: tuple[int, ...]
    t_first: int
    t_last: int


@dataclass(frozen=True, slots=True)
class Extract:
    """A piece as candump text, `frames` long. `shown` is False if not even the largest piece shows the finding."""

    wanted: Wanted
    text: bytes
    frames: int
    shown: bool


def extracts(
    wanted: Sequence[Wanted], again: Callable[[], Iterable[Piece]], registry: Registry, settings: Settings
) -> Iterator[Extract]:
    """A piece for each finding, in no particular order.

    Args:
        wanted: the findings.
        again: gives the capture from its start; it is read once for each size and `TOGETHER` findings.
        registry: the types to decode.
        settings: those that the findings were found with.
    """
    left = list(wanted)
    for reach in REACHES:
        missing: list[Wanted] = []
        for at in range(0, len(left), TOGETHER):
            some = left[at : at + TOGETHER]
            for one, piece, frames in _cut(some, again(), reach):
                if len(piece) <= MOST_BYTES and shows(one, piece, registry, settings):
                    yield Extract(one, piece, frames, shown=True)
                elif reach is None:
                    yield Extract(one, piece, frames, shown=False)
                else:
                    missing.append(one)
        left = missing


def shows(wanted: Wanted, text: bytes, registry: Registry, settings: Settings) -> bool:
    """Whether a capture shows the finding, with the same severity."""
    only = Settings(
        select={wanted.rule}, numbers=settings.numbers, severities=settings.severities, bit_rate=settings.bit_rate,
        dialects=settings.dialects,
    )  # fmt: skip
    judge, engine = Judge(registry, only), Engine(registry)
    for batch in engine.run([text]):
        judge.feed(batch)
    node = -1 if wanted.node is None else wanted.node
    return any(
        (key.rule, key.severity, key.node, key.type) == (wanted.rule, wanted.severity, node, wanted.type)
        for key, _ in judge.finish().runs
    )


def _cut(wanted: Sequence[Wanted], pieces: Iterable[Piece], reach: int | None) -> Iterator[tuple[Wanted, bytes, int]]:
    """The text around each finding."""
    writers = [Writer("candump") for _ in wanted]
    texts = [bytearray(writer.start()) for writer in writers]
    for part in slices(pieces):
        for one, writer, text in zip(wanted, writers, texts, strict=True):
            picked = _inside(part, one, reach) if len(text) <= MOST_BYTES else None
            if picked is not None:
                text.extend(writer.write(picked))
    for one, writer, text in zip(wanted, writers, texts, strict=True):
        yield one, bytes(text), writer.frames


def _inside(part: Slice, wanted: Wanted, reach: int | None) -> Piece | None:
    if reach is None:
        return part.piece
    limits: tuple[int | None, int | None] = (None, None)
    window = Window()
    if wanted.t_first != NO_TIME and (reach or not wanted.frames):
        limits = (wanted.t_first - reach, wanted.t_last + reach)
    elif wanted.frames:
        # Without times a frame counts as a millisecond, about what a bus of some load has.
        room = reach // MILLISECOND
        window = Window(frames=(min(wanted.frames) - room, max(wanted.frames) + room))
    else:
        return part.piece
    frames, events = rows_inside(part, window, limits)
    return part.piece.pick(frames.tobytes(), events.tobytes()) if len(frames) or len(events) else None
