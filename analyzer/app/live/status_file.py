"""The state of a session in a small file, for programs that look after it."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from datetime import UTC, datetime
from threading import Condition, Thread
from typing import TYPE_CHECKING, Any

from analyzer.report import wording
from analyzer.report.model import SEVERITIES
from analyzer.report.moments import on_calendar
from analyzer.sinks.atomic import Target, TargetError
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.board.snapshot import RecordingState
    from analyzer.report.model import Finding
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

SCHEMA = "tailbyte.live/1"
# Seconds between two states, and that a disk is waited for at the end.
EVERY, PATIENCE = 5.0, 2.0


class NewestText:
    """Puts texts into a file, whole or not at all, in a thread: no disk holds anybody up, and the newest one wins."""

    def __init__(self, path: str) -> None:
        self.problem = ""
        self._path = path
        self._next: str | None = None
        self._ended = False
        self._changed = Condition()
        self._thread = Thread(target=self._work, name="status file", daemon=True)
        self._thread.start()

    def put(self, text: str) -> None:
        """Take the next text."""
        with self._changed:
            self._next = text
            self._changed.notify()

    def close(self) -> None:
        """Write what waits, within `PATIENCE`."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(PATIENCE)

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._next is not None or self._ended)
                text, self._next = self._next, None
            if text is None:
                return
            try:
                write(self._path, text)
            except TargetError as error:
                self.problem = str(error)
            else:
                self.problem = ""


def write(path: str, text: str) -> None:
    """Put a text into a file, whole or not at all. Raises `TargetError`."""
    with Target(path) as target:
        target.file.write(text.encode("utf-8", "backslashreplace"))


class StatusFile:
    """Writes every few seconds how a session goes.

    Args:
        path: of the file, which is replaced as a whole.
        tell: takes a line.
        recording: says how the recording goes.
        now: seconds of a monotonic clock.
        clock: nanoseconds since 1970.

    Raises `TargetError` if it cannot be written now.
    """

    def __init__(
        self,
        path: str,
        tell: Callable[..., None],
        recording: Callable[[], RecordingState | None],
        now: Callable[[], float] = time.monotonic,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self.failed = False
        write(path, _rendered({"schema": SCHEMA, "state": "starting", "pid": os.getpid()}))
        self._file = NewestText(path)
        self._tell, self._recording, self._now, self._clock = tell, recording, now, clock
        self._started = clock()
        self._next = now()
        self._newest: Finding | None = None
        self._told = ""

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Keep the newest that is no note."""
        for one in changes:
            if one.fresh and one.finding.severity != "note":
                self._newest = one.finding

    def look(self, session: LiveSession) -> None:
        """Write it when it is time."""
        if self._now() >= self._next:
            self._next = self._now() + EVERY
            self._file.put(self._text(session, "running"))
        if (problem := self._file.problem) != self._told:
            self._told = problem
            if problem:
                self._tell(f"--status-file: {problem}")

    def end(self, session: LiveSession) -> None:
        """Write that it has ended."""
        self._file.put(self._text(session, "ended"))
        self._file.close()

    def _text(self, session: LiveSession, state: str) -> str:
        loop, recording = session.loop, self._recording()
        found = Counter(one.severity for one in session.newest.all)
        content: dict[str, Any] = {
            "schema": SCHEMA,
            "state": state,
            "pid": os.getpid(),
            "started": _iso(self._started),
            "time": _iso(self._clock()),
            "frames": loop.frames,
            "behind_s": round(loop.behind, 1),
            "unjudged": loop.unjudged,
            "interfaces": {
                name: {"received": one.received, "errors": one.errors, "dropped": one.dropped, "lost": one.lost}
                for name, one in loop.hub.counts.items()
            },
            "findings": {severity: found[severity] for severity in SEVERITIES},
            "newest": None if self._newest is None else _short(self._newest),
            "recording": None if recording is None else {
                "file": recording.file, "bytes": recording.size, "frames": recording.frames, "lost": recording.lost,
                "problem": recording.problem,
            },
            "problems": session.problems,
        }  # fmt: skip
        return _rendered(content)


def _rendered(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1) + "\n"


def _short(finding: Finding) -> dict[str, Any]:
    t = finding.first.t_ns
    return {
        "time": None if t is None else _iso(t), "severity": finding.severity, "rule": finding.rule,
        "bus": finding.bus, "node": finding.node, "text": wording.safe(f"{finding.title}: {finding.text}"),
    }  # fmt: skip


def _iso(t: int) -> str:
    if not on_calendar(t):
        return f"{t / SECOND:.3f}"
    return datetime.fromtimestamp(t // SECOND, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
