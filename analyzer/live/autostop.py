"""Conditions that end a live session: `-a` as dumpcap has it, `-c`, and findings."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol

from analyzer.live import conditions
from analyzer.live.patterns import FindingPattern, first_match, parse_pattern
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

    from analyzer._native import FrameBatch
    from analyzer.report.newest import Change

_NAMES = ("duration", "packets", "frames", "filesize", "files", "finding")


class Recorded(Protocol):
    """The progress of a recording."""

    @property
    def bytes(self) -> int:
        """In all files together."""

    @property
    def full(self) -> int:
        """Files that have had enough."""

    @property
    def gone(self) -> bool:
        """True if nobody reads it any more."""


@dataclass(frozen=True, slots=True)
class AutostopPlan:
    """The conditions that end a session, whichever comes first; None: never.

    Args:
        duration: nanoseconds from its start.
        frames: frames of all buses; the session ends behind the last of them.
        size: bytes that have been recorded, in all files together.
        files: files that have been filled.
        findings: one of these.
    """

    duration: int | None = None
    frames: int | None = None
    size: int | None = None
    files: int | None = None
    findings: tuple[FindingPattern, ...] = ()


def parse_autostop(texts: Iterable[str], count: int | None = None, rules: Collection[str] = ()) -> AutostopPlan:
    """Return the conditions of all `-a`; the last one of a name counts, but all findings. Raises `ValueError`.

    Args:
        texts: `duration:60`, `packets:N` or `frames:N`, `filesize:100` (kB of 1000 bytes) or `filesize:20MB`,
            `files:N`, `finding:error` (or worse), `finding:protocol:error`, `finding:TRF-010`, `finding:TRF`.
        count: that of `-c`.
        rules: the rules that there are.
    """
    found: dict[str, int] = {}
    findings: list[FindingPattern] = []
    for text in texts:
        name, value = conditions.split_condition("-a", text, _NAMES)
        if name == "duration":
            found[name] = conditions.parse_seconds("-a", name, value)
        elif name == "filesize":
            found["size"] = conditions.parse_size("-a", name, value)
        elif name == "finding":
            findings.append(parse_pattern("-a finding:", value, rules))
        else:
            found["files" if name == "files" else "frames"] = conditions.parse_number("-a", name, value)
    if count is not None:
        found["frames"] = min(count, found.get("frames", count))
    return AutostopPlan(**found, findings=tuple(findings))


class Autostop:
    """Looks whether a session has had enough. Its time runs from the first call of `due`.

    Args:
        plan: the conditions.
        recording: what is recorded, for `size` and `files`. What comes until the session ends is recorded, too.
        clock: monotonic nanoseconds.
    """

    def __init__(
        self, plan: AutostopPlan, recording: Recorded | None = None, clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._plan, self._recording, self._clock = plan, recording, clock
        self._frames = 0
        self._end: int | None = None
        self.reason = ""

    def cut(self, batch: FrameBatch) -> FrameBatch:
        """Return the batch up to the last frame that is wanted, and nothing of any batch behind that."""
        most = self._plan.frames
        if most is None or self._frames + batch.frames < most:
            self._frames += batch.frames
            return batch
        from analyzer.live.frame_batches import OrderedRows  # noqa: PLC0415 - takes its time

        ordered = OrderedRows(batch)
        wanted = most - self._frames
        self._frames = most
        return ordered.take(slice(0, ordered.behind_frame(wanted)))

    def take_findings(self, changes: Iterable[Change]) -> None:
        """Take findings."""
        finding = first_match(self._plan.findings, changes)
        if finding is not None:
            self._enough(f"{finding.rule} ({finding.severity})")

    def due(self) -> bool:
        """Return True if it is enough; `reason` says in words why."""
        plan, recording = self._plan, self._recording
        if plan.duration is not None:
            now = self._clock()
            self._end = self._end or now + plan.duration
            if now >= self._end:
                self._enough(f"{plan.duration / SECOND:g} s are over")
        if plan.frames is not None and self._frames >= plan.frames:
            self._enough(f"{plan.frames} frames")
        if recording is not None and plan.size is not None and recording.bytes >= plan.size:
            self._enough(f"{recording.bytes} bytes recorded")
        if recording is not None and plan.files is not None and recording.full >= plan.files:
            self._enough(f"{plan.files} files")
        if recording is not None and recording.gone:
            self._enough("nobody reads the recording any more")
        return bool(self.reason)

    def _enough(self, reason: str) -> None:
        self.reason = self.reason or reason
