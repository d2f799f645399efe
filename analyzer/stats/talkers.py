"""`talkers`: who sends how much of what, and what part of the bus that takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.traffic import Talk
from analyzer.stats.statistic import Statistic, percent
from analyzer.stats.sums import BEYOND, NO_TYPE, FrameSum
from analyzer.stats.table import StatColumn, StatTable
from analyzer.tables import KINDS, VERDICTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from analyzer.stats.traffic import Sender

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("type", "Type", "text"),
    StatColumn("kind", "Kind", "text", rank=-1),
    StatColumn("transfers", "Transfers"),
    StatColumn("bad", "Bad"),
    StatColumn("hz", "Hz", "number", 1),
    StatColumn("frames", "Frames", bar=True),
    StatColumn("frames_pct", "%", "number", 1),
    StatColumn("bytes", "Bytes", rank=1),
    StatColumn("bits_pct", "Bits %", "number", 1),
)
_USED = VERDICTS.index("used")
_ANONYMOUS = KINDS.index("anonymous")
_SUFFIX = {KINDS.index("request"): " request", KINDS.index("response"): " response"}


class TalkerTable(Statistic):
    """A row a sender and type; frames in no transfer have rows of their own, so that all add up."""

    def __init__(self, order: StatOrder) -> None:
        self._traffic = order.traffic
        self.parts = (order.traffic,)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the talkers, those who take most of the bus first."""
        talks = self._traffic.transfers()
        sums: dict[Sender | tuple[int, str], FrameSum] = {key: FrameSum() for key in talks}
        for key, one in self._traffic.frames():
            typed = key.verdict == _USED and key.kind > NO_TYPE
            of = (key.bus, key.node, key.kind, key.type_id) if typed else (key.bus, _rest(key.kind, key.verdict))
            sums.setdefault(of, FrameSum()).add(one.frames, one.size, one.bits)
        all_ = FrameSum()
        for one in sums.values():
            all_.add(one.frames, one.size, one.bits)
        rows: list[tuple[object, ...]] = []
        for of, one in sorted(sums.items(), key=lambda item: (-item[1].bits, str(item[0]))):
            shares = percent(one.frames, all_.frames), percent(one.bits, all_.bits)
            amount = one.frames, shares[0], one.size, shares[1]
            if len(of) == 2:
                rows.append((end.buses[of[0]], None, of[1], None, None, None, None, *amount))
                continue
            bus, node, kind, type_id = of
            talk = talks.get(of, Talk())
            rows.append((
                end.buses[bus], "anon" if kind == _ANONYMOUS else str(node),
                self._traffic.name(kind, type_id) + _SUFFIX.get(kind, ""), KINDS[kind],
                talk.count, talk.bad, talk.hz if end.timed else None, *amount,
            ))  # fmt: skip
        counts = [sum(getattr(talk, name) for talk in talks.values()) for name in ("count", "bad")]
        total = (
            None, "all", None, None, counts[0] + self._traffic.beyond, counts[1], None,
            all_.frames, 100.0, all_.size, 100.0,
        )  # fmt: skip
        about = "who sends what; % of all frames, and of all bits on the wire"
        return (StatTable("talkers", about, COLUMNS, rows, total=total),)


def _rest(kind: int, verdict: int) -> str:
    if kind == BEYOND:
        return "further nodes and types"
    return "not DroneCAN" if VERDICTS[verdict] == "foreign" else f"in no transfer: {VERDICTS[verdict]}"
