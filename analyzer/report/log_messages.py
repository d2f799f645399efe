"""Findings as messages of `foxglove.Log` for a log panel: one for each run of a fault, at its first occurrence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.report import wording
from analyzer.sinks import telemetry_log
from analyzer.sinks.telemetry_log import ERROR, INFO, WARNING, LogRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.report.model import Finding, Report
    from analyzer.sinks.extent import Extent

MOST = 1000  # messages; a panel with more of them shows nobody anything
_LEVELS = {"error": ERROR, "warning": WARNING, "note": INFO}
_MOST_FRAMES = 3  # of each finding, and its last one


def log_messages(report: Report, extent: Extent, file: str, *, windowed: bool) -> LogRows:
    """Return the messages about the findings of a report, the worst first; of a window, about those that meet it.

    A message has the time of the first occurrence. Its log time is the same, or that of the first exported frame where
    the occurrence has none or was before a window. `MOST` findings are told; one more message counts the others.
    """
    found = [one for one in report.findings if not windowed or meets(extent, one)]
    start = extent.times[0] if extent.times else 0
    several = wording.several_buses(report)
    told = [(one.first.t_ns, _LEVELS[one.severity], _message(one), _name(one, several=several)) for one in found[:MOST]]
    count = len(told)
    if more := len(found) - count:
        told.append((None, WARNING, f"{more} more findings are not shown here: see tailbyte check", "tailbyte"))
    own = np.array([start if t is None else t for t, *_ in told], np.int64)
    times = np.maximum(np.maximum(own, start) if windowed else own, 0)
    known = np.array([t is not None for t, *_ in told], bool)
    _, levels, texts, names = zip(*told, strict=True) if told else ((), (), (), ())
    return LogRows(times, telemetry_log.rows(np.maximum(own, 0), known, levels, texts, names, file), count)


def _message(one: Finding) -> str:
    said = ": ".join(text for text in (one.title, one.text) if text)
    where = ", ".join(text for text in (one.type, _course(one)) if text)
    return wording.safe(f"{one.rule} {said}" + (f" ({where})" if where else ""))


def _course(one: Finding) -> str:
    """Say how often, and in which frames: the first ones, and the last."""
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


def meets(extent: Extent, one: Finding) -> bool:
    """Return True if a finding goes on there: by its frames, else by its times; with neither, everywhere."""
    first, last = one.first, one.last
    if first.frame is not None and last.frame is not None:
        return extent.has_frames(first.frame, last.frame)
    if first.t_ns is not None and last.t_ns is not None:
        return extent.has_times(first.t_ns, last.t_ns)
    return True
