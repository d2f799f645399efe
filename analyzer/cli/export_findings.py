"""The findings of a capture that is being exported: its batches are judged while the tables are written."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from analyzer.conformance import order
from analyzer.report.build import Taken, build
from analyzer.rules.checking import Check
from analyzer.rules.gate import DEFAULT, FailOn
from analyzer.rules.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.cli.session import Session
    from analyzer.engine import Batch
    from analyzer.report.model import Report

_ROOM = 2  # batches that wait to be judged


class Judging:
    """All rules as `tailbyte check` without options has them, in a thread beside."""

    def __init__(self, session: Session) -> None:
        self._session, self._settings = session, Settings()
        self._check = Check(session.registry, self._settings)

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """The batches, which are judged in their order; all are when the last one is through."""
        waiting = deque[Future[None]]()
        with ThreadPoolExecutor(1, "judging") as thread:
            for measured in self._check.measured(batches):
                waiting.append(thread.submit(self._check.feed, measured))
                if len(waiting) > _ROOM:
                    waiting.popleft().result()
                yield measured.batch
            for judged in waiting:
                judged.result()

    def report(self) -> Report:
        """What was found, after the last batch."""
        source = self._session.source
        checked = self._check.finish(source.parts, self._session.engine)
        taken = Taken(id=source.name, path=source.name, checked=checked, live=source.live)
        told = order(FailOn.parse([DEFAULT]), {}, None, None)
        return build([taken], self._session.registry, self._check.judge.pages, self._settings, told)
