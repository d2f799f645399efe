"""A small piece of a capture that still shows a finding: a window around its first evidence, then less and less of it.

Every piece is judged anew. Where the capture has times, a piece has to show the finding at the same time as the whole
capture, if any piece does, and in the same words as it gets smaller: leaving something out must not make up a finding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer._native import Writer
from analyzer.decode.engine import Engine
from analyzer.rules.extract.shrink import MOST_TRIALS, Shrinker
from analyzer.rules.judge import Judge
from analyzer.window.cut import frame_tables, rows_inside
from analyzer.window.limits import Window
from analyzer.window.numbering import Numbering
from dissectors.kit import MILLISECOND, NO_TIME, SECOND
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer._native import FrameBatch
    from analyzer.rules.settings import Settings
    from analyzer.window.cut import FrameTables
    from dissectors import Registry

# Time before and after the evidence, tried in this order; None is the whole capture.
REACHES = (0, 50 * MILLISECOND, 500 * MILLISECOND, 2500 * MILLISECOND, 12 * SECOND, 70 * SECOND, None)
MOST_BYTES = 64 * 1024 * 1024  # of one piece
TOGETHER = 16  # pieces collected in one reading of the capture
ALL_TRIALS = 4000  # to make the pieces smaller, shared between them
FEWEST_TRIALS = 24  # of each of them

Place = tuple[int, str]  # the time of an occurrence, and its words


@dataclass(frozen=True, slots=True)
class WantedFinding:
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
    """A piece as candump text of some `lines`. `shown` is False if not even the largest piece shows the finding."""

    wanted: WantedFinding
    text: bytes
    lines: int
    shown: bool


def extracts(
    wanted: Sequence[WantedFinding], again: Callable[[], Iterable[FrameBatch]], registry: Registry, settings: Settings
) -> Iterator[Extract]:
    """Yield a piece for each finding, in no particular order.

    Args:
        wanted: the findings.
        again: gives the capture from its start; it is read once for each size and `TOGETHER` findings.
        registry: the types to decode.
        settings: those that the findings were found with.
    """
    left = list(wanted)
    trials = max(min(MOST_TRIALS, ALL_TRIALS // max(len(left), 1)), FEWEST_TRIALS)
    alone, among = _Court(registry, settings, alone=True), _Court(registry, settings, alone=False)
    second: dict[int, bytes] = {}  # pieces that show such a finding, but at another time
    for reach in REACHES:
        missing: list[WantedFinding] = []
        for at in range(0, len(left), TOGETHER):
            some = left[at : at + TOGETHER]
            for one, piece in _cut(some, again(), reach):
                fits = len(piece) <= MOST_BYTES
                places = alone.places(one, piece) if fits else []
                if places and one.t_first in (NO_TIME, *(t for t, _ in places)):
                    yield _smaller(one, piece, alone, trials)
                    continue
                if places:
                    second.setdefault(id(one), piece)
                if reach is not None:
                    missing.append(one)
                elif id(one) in second:
                    yield _smaller(one, second[id(one)], alone, trials)
                elif fits and among.places(one, piece):
                    yield _smaller(one, piece, among, trials)
                else:
                    yield Extract(one, piece, piece.count(b"\n"), shown=False)
        left = missing


def _smaller(wanted: WantedFinding, text: bytes, court: _Court, trials: int) -> Extract:
    places = court.places(wanted, text)
    place = next((one for one in places if one[0] == wanted.t_first), places[0])
    shrinker = Shrinker(lambda some: place in court.places(wanted, some), trials)
    lines = shrinker.shrink(text.splitlines(keepends=True))
    return Extract(wanted, b"".join(lines), len(lines), shown=True)


@dataclass(frozen=True, slots=True)
class _Court:
    """Judges pieces by the rule of a finding `alone`, or by all: some rules excuse what breaks another one."""

    registry: Registry
    settings: Settings
    alone: bool

    def places(self, wanted: WantedFinding, text: bytes) -> list[Place]:
        """Return where a capture shows the finding, with the same severity if one is wanted."""
        settings = replace(self.settings, select={wanted.rule}, ignore=()) if self.alone else self.settings
        judge, engine = Judge(self.registry, settings), Engine(self.registry, settings.dialects, ahead=True)
        for batch in engine.run([text]):
            judge.feed(batch)
        node = -1 if wanted.node is None else wanted.node
        return [
            (shown.t, shown.text)
            for key, run in judge.finish().runs
            if (key.rule, key.node, key.type) == (wanted.rule, node, wanted.type)
            and wanted.severity in ("", key.severity)
            for shown in run.examples
        ]


def _cut(
    wanted: Sequence[WantedFinding], pieces: Iterable[FrameBatch], reach: int | None
) -> Iterator[tuple[WantedFinding, bytes]]:
    """Yield the text around each finding."""
    writers = [Writer("candump") for _ in wanted]
    texts = [bytearray(writer.start()) for writer in writers]
    for part in frame_tables(pieces):
        for one, writer, text in zip(wanted, writers, texts, strict=True):
            picked = _inside(part, one, reach) if len(text) <= MOST_BYTES else None
            if picked is not None:
                text.extend(writer.write(picked))
    for one, text in zip(wanted, texts, strict=True):
        yield one, bytes(text)


def _inside(part: FrameTables, wanted: WantedFinding, reach: int | None) -> FrameBatch | None:
    if reach is None:
        return part.batch
    limits: tuple[int | None, int | None] = (None, None)
    window = Window()
    if wanted.t_first != NO_TIME and (reach or not wanted.frames):
        limits = (wanted.t_first - reach, wanted.t_last + reach)
    elif wanted.frames:
        # Without times a frame counts as a millisecond, about what a bus of some load has.
        room = reach // MILLISECOND
        window = Window(frames=(min(wanted.frames) - room, max(wanted.frames) + room))
    else:
        return part.batch
    frames, events = rows_inside(part, window, limits, Numbering())
    return part.batch.pick(frames.tobytes(), events.tobytes()) if len(frames) or len(events) else None
