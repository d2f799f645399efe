"""Statistics of a run, several of them in one reading."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.stats.catalogue import statistics
from analyzer.stats.chosen import Chooser, frame_rows
from analyzer.stats.statistic import FoundBreach, StatEnd
from analyzer.views.stats.head import StatHead

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.app.filtered.run_filter import RunFilter
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.filter.matcher import Matcher
    from analyzer.report.model import Finding
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.sources.dataflash import AutopilotLog
    from analyzer.stats.table import StatTable

BIT_RATE = 1_000_000


class RunStatistics:
    """Adds up the batches of a run.

    Args:
        run: not read yet.
        texts: `NAME[,ARGUMENT...]` of each statistic.
        bit_rate: of the bus, in bits a second.
        autopilot: the autopilot's own log of the flight.

    Raises `ValueError` for what makes no sense (`FilterError` is one), and `OSError` for a vehicle file.
    """

    def __init__(
        self, run: Run, texts: Sequence[str], bit_rate: int | None = None, autopilot: AutopilotLog | None = None
    ) -> None:
        self._run, self._bit_rate = run, bit_rate or BIT_RATE
        self._named: NamedFrames | None = None
        self._where = None if run.request.filter is None else self._filter(run.request.filter)
        filtered = self._where is not None
        self._all = statistics(
            texts, run.registry, self._bit_rate, self._matcher, filtered=filtered, autopilot=autopilot
        )
        self._parts = list(dict.fromkeys(part for one in self._all for part in (*one.parts, one)))
        if self._where is None:
            self._chooser = Chooser()
        else:
            self._chooser = Chooser(self._where.matcher(frame_list=True), self._where.note)
        self.start: int | None = None
        self.end: int | None = None
        self.transfers = self.frames = self.chosen_transfers = self.chosen_frames = 0
        self._found: Sequence[FoundBreach] = ()
        run.engine.core.measured = True

    def read(self) -> None:
        """Read the run, or what is inside its window."""
        for _ in self.over(self._run.inside()):
            pass

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches of the run, and add each; findings are looked for in a thread beside if they are needed.

        Raises `TooManyIntervalsError`, a `ValueError`, for an interval that is too short.
        """
        if not any(one.judges for one in self._all):
            yield from self._added(batches)
            return
        from analyzer.app.criteria import Criteria  # noqa: PLC0415 - few statistics need rules
        from analyzer.app.judged import JudgedRun  # noqa: PLC0415

        criteria = Criteria(self._run.request.rules, self._run.registry)
        label, matching = self._run.source.name, None
        named, buses = None, dict[str, int]()
        if self._where is not None:
            from analyzer.app.filtered.findings import MatchingFindings  # noqa: PLC0415 - as above

            matching = MatchingFindings()
            named, buses = matching.judging(self._run, label)
        judged = JudgedRun(self._run, criteria, named)
        yield from self._added(judged.beside(batches))
        buses |= {name: index for index, name in enumerate(self._run.engine.buses)}
        report = criteria.report([judged.taken(label)])
        found = (report if matching is None else matching.cut(report)).findings
        self._found = [_counted(run) for run in _as_shown(found)]

    def conclude(self) -> None:
        """Complain of types that the filter asks for and the capture does not have."""
        if self._where is not None:
            self._where.transfers, self._where.frames = self.chosen_transfers, self.chosen_frames
            self._where.conclude()

    def head(self) -> StatHead:
        """Return what stands above the tables."""
        request = self._run.request
        counts = (self.chosen_frames, self.frames), (self.chosen_transfers, self.transfers)
        times = self.start, self.end, self._end().timed
        repeated = self._run.totals.lines["repeated"]
        return StatHead(
            request.names, self._run.engine.buses, *times, request.filter, request.window_words, *counts, repeated
        )

    def tables(self) -> list[StatTable]:
        """Return the tables, after the last batch."""
        end = self._end()
        return [table for one in self._all for table in one.finish(end)]

    @property
    def autopilot(self) -> Mapping[str, Any] | None:
        """The fate of the autopilot's log, after `tables`."""
        return next((one.autopilot for one in self._all if one.autopilot is not None), None)

    def _end(self) -> StatEnd:
        return StatEnd(
            self._run.registry, self._run.engine, self._run.source.parts, self._bit_rate, self.start, self.end,
            self._found,
        )  # fmt: skip

    def _added(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        for batch in batches:
            rows = frame_rows(batch)
            if rows.timed.any():
                t = rows.t if rows.timed.all() else rows.t[rows.timed]
                first, last = int(t.min()), int(t.max())
                self.start = first if self.start is None else min(self.start, first)
                self.end = last if self.end is None else max(self.end, last)
            chosen = self._chooser.feed(batch, rows)
            self.frames += len(rows.bus)
            self.transfers += len(batch.transfers)
            self.chosen_transfers += len(batch.transfers) if chosen.rows is None else len(chosen.rows)
            self.chosen_frames += sum(sign * len(some.bus) for some, sign in chosen.changes)
            for part in self._parts:
                part.feed(chosen)
            yield batch

    def _matcher(self, text: str) -> Matcher:
        """Return a filter at work that asks for what the request asks for and `text` beside it."""
        where = self._run.request.filter
        return self._filter(text if where is None else f"({where}) && ({text})").matcher(frame_list=True)

    def _filter(self, text: str) -> RunFilter:
        """Return a filter that knows what the capture, its vehicle file and its findings say."""
        from analyzer.app.filtered.run_filter import RunFilter as MadeFilter  # noqa: PLC0415 - many have none

        found = MadeFilter(self._run, text)
        if found.judges:
            from analyzer.app.naming import named_frames  # noqa: PLC0415 - few filters ask for findings

            if self._named is None:
                self._named = named_frames(self._run, "a filter with finding.*")
            found.know(self._named)
        return found


def _as_shown(found: Sequence[Finding]) -> Iterator[Finding]:
    """Yield findings in the order in which `check` shows them."""
    from analyzer.report.headline import sections  # noqa: PLC0415 - few statistics need findings
    from analyzer.report.problems import problems  # noqa: PLC0415 - as above

    for _, some in sections(problems(found)):
        for problem in some:
            yield from problem.runs


def _counted(one: Finding) -> FoundBreach:
    who = one.label or (one.bus if one.node is None else f"node {one.node}")
    return FoundBreach(one.rule, one.severity, one.category, one.title, one.count, who, one.first.t_ns, one.last.t_ns)
