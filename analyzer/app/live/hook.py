"""A command that is run for findings as they begin: for sessions that nobody watches."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import time
from collections import deque
from threading import Condition, Thread
from typing import TYPE_CHECKING

from analyzer.live.patterns import FindingPattern, parse_pattern
from analyzer.report import wording
from analyzer.report.json import render_finding
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.report.model import Finding
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Commands that run at a time, and findings that wait for them.
MOST, WAITING = 4, 64
# Seconds that the end of a session waits for those that run.
PATIENCE = 5.0
_NAMES = ("rule", "severity", "category", "bus", "node", "type", "time", "text")
_PLACE = re.compile(r"\{(\w+)\}")


@dataclass(frozen=True, slots=True)
class FindingCommand:
    """A command, word by word, and the findings that it is run for."""

    words: tuple[str, ...]
    wanted: tuple[FindingPattern, ...]

    def filled(self, finding: Finding) -> list[str]:
        """Return the words with what is said of a finding in place of `{rule}` and the like, harmless to a terminal."""
        said = {
            "rule": finding.rule, "severity": finding.severity, "category": finding.category, "bus": finding.bus,
            "node": "" if finding.node is None else str(finding.node), "type": finding.type,
            "time": wording.moment(finding.first.t_ns, None, form="%Y-%m-%dT%H:%M:%S"),
            "text": f"{finding.title}: {finding.text}",
        }  # fmt: skip
        return [_PLACE.sub(lambda found: wording.safe(said[found[1]]), word) for word in self.words]


def parse_command(text: str | None, wanted: Sequence[str], rules: Collection[str]) -> FindingCommand | None:
    """Read `--exec`, words as a shell has them, and `--exec-on`; None if nothing is to be run. Raises `ValueError`."""
    if text is None:
        if wanted:
            raise ValueError("--exec-on is of no use without --exec")
        return None
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ValueError(f"--exec: {error}") from None
    if not words or shutil.which(words[0]) is None:
        raise ValueError(f"--exec: {words[0]}: there is no such program" if words else "--exec: no command")
    for name in _PLACE.findall(" ".join(words)):
        if name not in _NAMES:
            raise ValueError(f"--exec: {{{name}}} stands for nothing (there is {', '.join(_NAMES)})")
    return FindingCommand(tuple(words), tuple(parse_pattern("--exec-on", one, rules) for one in wanted or ("error",)))


class FindingHook:
    """Runs a command for each finding that is new and wanted, in threads of its own: the session never waits.

    The finding is on its standard input, as JSON; what it writes goes nowhere. Up to `MOST` run at a time and up to
    `WAITING` findings wait; what does not fit is counted and told, and so is a command that fails.

    Args:
        command: what to run, and when.
        tell: takes a line.
    """

    def __init__(self, command: FindingCommand, tell: Callable[..., None]) -> None:
        self.failed = False
        self._command, self._tell = command, tell
        self._changed = Condition()
        self._queue: deque[Finding] = deque()
        self._running: set[subprocess.Popen[bytes]] = set()
        self._threads: list[Thread] = []
        self._idle = self._left_out = self._told = 0
        self._ended = False
        self._problem = self._said = ""

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Take findings."""
        wanted = [one.finding for one in changes if one.fresh and self._wants(one.finding)]
        with self._changed:
            for finding in wanted:
                if len(self._queue) >= WAITING:
                    self._left_out += 1
                    continue
                self._queue.append(finding)
                if self._idle < len(self._queue) and len(self._threads) < MOST:
                    self._threads.append(Thread(target=self._work, name="exec", daemon=True))
                    self._threads[-1].start()
            self._changed.notify_all()

    def look(self, session: LiveSession) -> None:
        """Tell what went wrong since the last time."""
        del session
        with self._changed:
            left_out, problem = self._left_out, self._problem
        if left_out > self._told:
            self._tell(f"--exec: not run, as too many wait: {left_out - self._told:,} findings")
            self._told = left_out
        if problem != self._said:
            self._said = problem
            self._tell(f"--exec: {problem}")

    def close(self) -> None:
        """Wait for those that wait and run, within `PATIENCE`; end what runs then."""
        end = time.monotonic() + PATIENCE
        with self._changed:
            self._ended = True
            self._changed.notify_all()
            while (self._queue or self._running) and (left := end - time.monotonic()) > 0:
                self._changed.wait(left)
            self._queue.clear()
            for process in self._running:
                process.kill()

    def _wants(self, finding: Finding) -> bool:
        return any(pattern.matches(finding) for pattern in self._command.wanted)

    def _work(self) -> None:
        while True:
            with self._changed:
                self._idle += 1
                self._changed.wait_for(lambda: self._queue or self._ended)
                self._idle -= 1
                if not self._queue:
                    return
                finding = self._queue.popleft()
                process = self._start(finding)
                if process is not None:
                    self._running.add(process)
            if process is not None:
                process.communicate(render_finding(finding).encode())
            with self._changed:
                if process is not None:
                    self._running.discard(process)
                    if process.returncode:
                        self._problem = f"{self._command.words[0]} ends with status {process.returncode}"
                self._changed.notify_all()

    def _start(self, finding: Finding) -> subprocess.Popen[bytes] | None:
        nothing = subprocess.DEVNULL
        try:
            return subprocess.Popen(  # noqa: S603 - what the user says is to be run, without a shell
                self._command.filled(finding), stdin=subprocess.PIPE, stdout=nothing, stderr=nothing,
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            self._problem = f"{self._command.words[0]}: {error.strerror or error}"
            return None
