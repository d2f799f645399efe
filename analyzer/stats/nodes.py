"""`nodes`: a row a node, as `info` knows it, the odd ones marked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.summary import Summary
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("ch", "Ch", "text"),
    StatColumn("role", "Role", "text"),
    StatColumn("name", "Name", "text", rank=2),
    StatColumn("software", "Software", "text"),
    StatColumn("uptime_s", "Uptime", "span", rank=1),
    StatColumn("sends_hz", "Sends/s", "number", 1),
    StatColumn("transfers", "Transfers", rank=2),
    StatColumn("lost", "Lost"),
    StatColumn("bad", "Bad"),
    StatColumn("restarts", "Restarts"),
    StatColumn("seen", "Seen", "stay"),
    StatColumn("first_ns", "First", "time", rank=-1),
    StatColumn("last_ns", "Last", "time", rank=-1),
    StatColumn("odd", "Odd", "text", rank=-1),
    StatColumn("mark", "", "mark"),
)


class NodeTable(Statistic):
    """The nodes that send: what each is from all that came, how much of it from what was chosen."""

    def __init__(self, order: StatOrder) -> None:
        self._summary = Summary(order.registry)

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._summary.feed(batch.whole)

    def marks(self, _: StatEnd) -> Mapping[tuple[int, int], Sequence[str]]:
        """Return what else is odd about nodes, by bus and node: nothing that is known here."""
        return {}

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the nodes, by interface and number."""
        facts = self._summary.finish(end.stored, end.engine)
        marks = self.marks(end)
        odd = [(*one.odd, *marks.get((_index(end, one.bus), one.node), ())) for one in facts.senders]
        rows = [
            (
                one.bus, "anon" if one.anonymous else str(one.node), ",".join(map(str, one.channels)),
                ", ".join(one.roles) or ("" if one.known else "unknown"), one.name, one.software or "", one.uptime,
                one.hz, one.count, one.lost, one.bad, one.restarts, (one.first, one.last), one.first, one.last,
                ", ".join(words), "odd" * bool(words),
            )
            for one, words in zip(facts.senders, odd, strict=True)
        ]  # fmt: skip
        several = len(facts.buses) > 1
        notes = [
            f"! {f'{one.bus} ' * several}node {one.node} differs from the others of its role: {', '.join(one.odd)}"
            for one in facts.senders
            if one.odd
        ]
        notes += [
            f"! {f'{one.bus} ' * several}node {one.node}: {'; '.join(words[len(one.odd) :])}; see stats odd"
            for one, words in zip(facts.senders, odd, strict=True)
            if len(words) > len(one.odd)
        ]
        notes += [
            f"! {f'{one.bus} ' * several}node {one.node}: two transfer-ID counters under one node ID, so that what was "
            "lost cannot be counted; see check, BUS-010"
            for one in facts.senders
            if one.lost is None
        ]
        sums = (sum(getattr(one, name) or 0 for one in facts.senders) for name in ("lost", "bad"))
        total = (None, "all", *[None] * 6, facts.transfers, *sums, *[None] * 6)
        return (StatTable("nodes", "who sends; Lost = missing by transfer IDs", COLUMNS, rows, notes, total=total),)


def _index(end: StatEnd, bus: str) -> int:
    return list(end.buses).index(bus) if bus in end.buses else -1
