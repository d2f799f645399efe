"""Findings of the rules for a log panel: one message for each run of a fault, at its first occurrence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.report import wording
from analyzer.sinks import telemetry_log
from analyzer.sinks.telemetry_log import ERROR, INFO, WARNING
from analyzer.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
    import pyarrow as pa

    from analyzer.report.model import Finding, Report
    from analyzer.sinks.part import Part

MOST = 1000  # messages; a panel with more of them shows nobody anything
_LEVELS = {"error": ERROR, "warning": WARNING, "note": INFO}
_MOST_FRAMES = 3  # of each finding, and its last one

# ---- which of them --------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Extent:
    """First and last frame of what is exported: their numbers, from 1, and times in ns; None before there are any."""

    frames: tuple[int, int] | None = None
    times: tuple[int, int] | None = None

    def add(self, part: Part) -> None:
        """The next frames."""
        self.frames = _wider(self.frames, part.frame_rows.astype(np.int64) + 1)
        column = part.frames.column("t")
        self.times = _wider(self.times, numbers(column)[~np.asarray(column.is_null())])

    def meets(self, finding: Finding) -> bool:
        """Whether a finding goes on there: by its frames, else by its times; one with neither holds everywhere."""
        first, last = finding.first, finding.last
        if first.frame is not None and last.frame is not None:
            return _overlap(self.frames, first.frame, last.frame)
        if first.t_ns is not None and last.t_ns is not None:
            return _overlap(self.times, first.t_ns, last.t_ns)
        return True


def _wider(known: tuple[int, int] | None, more: npt.NDArray[Any]) -> tuple[int, int] | None:
    ends = [*(known or ()), *((int(more.min()), int(more.max())) if len(more) else ())]
    return (min(ends), max(ends)) if ends else None


def _overlap(span: tuple[int, int] | None, *ends: int) -> bool:
    return span is not None and min(ends) <= span[1] and max(ends) >= span[0]


# ---- what they say --------------------------------------------------------------------------------------------------


def log(report: Report, extent: Extent, file: str, *, windowed: bool) -> tuple[npt.NDArray[np.int64], pa.RecordBatch]:
    """Log times and messages, the worst first.

    A message has the time of the first occurrence. Its log time is the same, or that of the first exported frame where
    the occurrence has none or was before a window. `MOST` findings are told; one more message counts the others.
    """
    found = [one for one in report.findings if not windowed or extent.meets(one)]
    start = extent.times[0] if extent.times else 0
    several = wording.several_buses(report)
    told = [(one.first.t_ns, _LEVELS[one.severity], _message(one), _name(one, several=several)) for one in found[:MOST]]
    if more := len(found) - len(told):
        told.append((None, WARNING, f"{more} more findings are not shown here: see tailbyte check", "tailbyte"))
    own = np.array([start if t is None else t for t, *_ in told], np.int64)
    times = np.maximum(np.maximum(own, start) if windowed else own, 0)
    known = np.array([t is not None for t, *_ in told], bool)
    _, levels, texts, names = zip(*told, strict=True) if told else ((), (), (), ())
    return times, telemetry_log.rows(np.maximum(own, 0), known, levels, texts, names, file)


def _message(one: Finding) -> str:
    said = ": ".join(text for text in (one.title, one.text) if text)
    where = ", ".join(text for text in (one.type, _course(one)) if text)
    return wording.safe(f"{one.rule} {said}" + (f" ({where})" if where else ""))


def _course(one: Finding) -> str:
    """How often, and in which frames: the first ones, and the last."""
    last = one.last.frame
    early = dict.fromkeys(frame for frame in (one.first.frame, *one.frames) if frame not in (None, last))
    frames = [*early, *([] if last is None else [last])]
    shown: Sequence[object] = frames
    if len(frames) > _MOST_FRAMES + 1:
        shown = [*frames[:_MOST_FRAMES], "...", frames[-1]]
    words = [f"{one.count} times"] if one.count > 1 else []
    if frames:
        words.append(f"frame{'' if len(frames) == 1 else 's'} {' '.join(map(str, shown))}")
    return ", ".join(words)


def _name(one: Finding, *, several: bool) -> str:
    return wording.place(one, bus=several) if one.bus or one.node is not None else "capture"
