"""`hierarchy`: frames and bytes by interface, protocol, kind and type, as a tree."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.stats.statistic import Statistic, percent
from analyzer.stats.sums import NO_TYPE
from analyzer.stats.table import StatColumn, StatTable
from analyzer.tables import KINDS, VERDICTS
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from analyzer.stats.sums import SumKey

COLUMNS = (
    StatColumn("layer", "Layer", "text"),
    StatColumn("depth", "Depth", rank=-1),
    StatColumn("path", "Path", "text", rank=-1),
    StatColumn("frames", "Frames", bar=True),
    StatColumn("frames_pct", "%", "number", 1),
    StatColumn("bytes", "Bytes"),
    StatColumn("bytes_pct", "%", "number", 1),
    StatColumn("transfers", "Transfers"),
    StatColumn("bad", "Bad"),
)
_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_REQUEST = KINDS.index("request")
_GROUPS = ("messages", "anonymous messages", "services", "services")
_SUFFIX = {KINDS.index("request"): " request", KINDS.index("response"): " response"}
_PATH = " > "


@dataclass(slots=True)
class _Layer:
    """A line of the tree, with what stands below it."""

    frames: int = 0
    size: int = 0
    transfers: int = 0
    bad: int = 0
    below: dict[str, _Layer] = field(default_factory=dict)

    def at(self, path: Sequence[str]) -> Iterator[_Layer]:
        """Yield the layers on the way down, this one first."""
        yield self
        if path:
            yield from self.below.setdefault(path[0], _Layer()).at(path[1:])


class Hierarchy(Statistic):
    """Every frame is counted once in each layer above it: a layer is the sum of those below."""

    def __init__(self, order: StatOrder) -> None:
        self._traffic = order.traffic
        self.parts = (order.traffic,)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the tree, the largest first."""
        top = _Layer()
        talks = self._traffic.transfers()
        for key, one in self._traffic.frames():
            for layer in top.at((end.buses[key.bus], *self._path(key))):
                layer.frames += one.frames
                layer.size += one.size
        for (bus, _, kind, type_id), talk in talks.items():
            for layer in top.at((end.buses[bus], *self._typed(kind, type_id))):
                layer.transfers += talk.count
                layer.bad += talk.bad
        depths, rows = zip(*_rows(top, top, 0, ()), strict=True) if top.below else ((), ())
        total = ("all", 0, "", top.frames, 100.0, top.size, 100.0, top.transfers + self._traffic.beyond, top.bad)
        about = "frames and data bytes by protocol; % of all"
        return (StatTable("hierarchy", about, COLUMNS, rows, total=total, indent=depths),)

    def _typed(self, kind: int, type_id: int) -> tuple[str, ...]:
        return "DroneCAN", _GROUPS[kind], self._traffic.name(kind, type_id) + _SUFFIX.get(kind, "")

    def _path(self, key: SumKey) -> tuple[str, ...]:
        if key.verdict == _FOREIGN:
            return ("not DroneCAN",)
        if key.verdict != _USED:
            return "DroneCAN", "in no transfer", VERDICTS[key.verdict]
        return self._typed(key.kind, key.type_id) if key.kind > NO_TYPE else ("DroneCAN", "other types")


def _rows(layer: _Layer, top: _Layer, depth: int, path: tuple[str, ...]) -> Iterator[tuple[int, tuple[object, ...]]]:
    """Yield the depth of each line, and the line."""
    for name, one in sorted(layer.below.items(), key=lambda item: (-item[1].frames, item[0])):
        shares = percent(one.frames, top.frames), percent(one.size, top.size)
        counts = one.frames, shares[0], one.size, shares[1], one.transfers, one.bad
        yield depth, (name, depth, _PATH.join((*path, name)), *counts)
        yield from _rows(one, top, depth + 1, (*path, name))
