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
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.sinks.extent import Extent


class FoundTable:
    """Judges a run while somebody else uses its batches, and remembers which transfer holds which frame.

    Args:
        run: not read yet.
        criteria: of the same types.
        folder: where temporary files are made; None is where the system has them.
    """

    def __init__(self, run: Run, criteria: Criteria, folder: str | None = None) -> None:
        self._criteria = criteria
        self._judged = JudgedRun(run, criteria)
        self._index = TransferIndex(folder)

    def beside(self, decoded: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches of the run, which a thread beside judges."""
        for batch in self._judged.beside(decoded):
            self._index.feed(batch)
            yield batch

    def rows(self, extent: Extent | None = None) -> pa.RecordBatch:
        """Return the table, after the last batch: all findings, or those that go on in the `extent` of a window."""
        run = self._judged.run
        report = self._criteria.report([self._judged.taken(run.source.name)])
        found = [one for one in report.findings if extent is None or meets(extent, one)]
        transfers = self._index.find(findings_table.frames_of(found))
        return findings_table.table(found, run.engine.buses, transfers)

    def close(self) -> None:
        """Give the room back."""
        self._index.close()
