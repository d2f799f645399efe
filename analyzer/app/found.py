"""Findings as a table of the run that they are about."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.judged import JudgedRun
from analyzer.report import findings_table
from analyzer.report.log_messages import meets
from analyzer.sinks.transfer_index import TransferIndex

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pyarrow as pa

    from analyzer.app.criteria import Criteria
    from analyzer.app.filtered.frames import MatchingFrames
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.report.model import Report
    from analyzer.sinks.extent import Extent


class FilteredJudge(JudgedRun):
    """A run under all rules, of whose findings those are reported that a filter selects; all without one.

    Args:
        run: not read yet.
        criteria: of the same types.
        chosen: what the filter selects.
    """

    def __init__(self, run: Run, criteria: Criteria, chosen: MatchingFrames | None) -> None:
        self._criteria, self._matching = criteria, None
        named, self._buses = None, dict[str, int]()
        if chosen is not None:
            from analyzer.app.filtered.findings import MatchingFindings  # noqa: PLC0415 - few have a filter

            self._matching = MatchingFindings()
            named, self._buses = self._matching.know(chosen, run.source.name)
        super().__init__(run, criteria, named)

    def report(self) -> Report:
        """Return the report, after the last batch."""
        report = self._criteria.report([self.taken(self.run.source.name)])
        if self._matching is None:
            return report
        self._buses |= {name: index for index, name in enumerate(self.run.engine.buses)}
        return self._matching.cut(report)


class FoundTable:
    """Judges a run while somebody else uses its batches, and remembers which transfer holds which frame.

    Args:
        run: not read yet.
        criteria: of the same types.
        folder: where temporary files are made; None is where the system has them.
        chosen: what a filter selects; findings are those that name a frame of it.
    """

    def __init__(
        self, run: Run, criteria: Criteria, folder: str | None = None, chosen: MatchingFrames | None = None
    ) -> None:
        self._criteria = criteria
        self._judged = FilteredJudge(run, criteria, chosen)
        self._index = TransferIndex(folder)

    def beside(self, decoded: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches of the run, which a thread beside judges."""
        for batch in self._judged.beside(decoded):
            self._index.feed(batch)
            yield batch

    def rows(self, extent: Extent | None = None) -> pa.RecordBatch:
        """Return the table, after the last batch: all findings, or those that go on in the `extent` of a window."""
        run, report = self._judged.run, self._judged.report()
        found = [one for one in report.findings if extent is None or meets(extent, one)]
        transfers = self._index.find(findings_table.frames_of(found))
        return findings_table.table(found, run.engine.buses, transfers)

    def close(self) -> None:
        """Give the room back."""
        self._index.close()
