"""The findings of `check`, as a log beside the plots: one line a finding, at the time of its first frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot.chunks import path
from analyzer.plot.inventory import Series
from analyzer.plot.moments import NO_FRAME, Moments
from analyzer.report import wording
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.plot.canvas import Canvas
    from analyzer.report.model import Finding, Severity

FINDINGS = "findings"
_LEVELS: dict[Severity, str] = {"error": "ERROR", "warning": "WARN", "note": "INFO"}
_FRAMES = 10


def draw(canvas: Canvas, findings: Iterable[Finding], *, several: bool) -> None:
    """Draw a line for each finding, a series a severity; `several` says that there are buses to tell apart."""
    found = list(findings)
    for severity, level in _LEVELS.items():
        here = [one for one in found if one.severity == severity]
        entity = path(FINDINGS, severity)
        for timed in (True, False):
            for framed in (True, False):
                rows = [
                    one for one in here
                    if (one.first.t_ns is not None) == timed and (one.first.frame is not None) == framed
                ]  # fmt: skip
                if not rows:
                    continue
                series = canvas.inventory.series.get(entity) or Series(
                    entity, "text", FINDINGS, severity, owner=FINDINGS
                )
                moments = Moments(
                    np.array([NO_TIME if one.first.t_ns is None else one.first.t_ns for one in rows], np.int64),
                    np.array([NO_FRAME if one.first.frame is None else one.first.frame for one in rows], np.int64),
                )
                texts = [
                    f"{'' if one.first.t_ns is None else canvas.clock.written(one.first.t_ns)} "
                    f"{line(one, several=several)}".lstrip()
                    for one in rows
                ]
                canvas.texts(series, texts, [level] * len(rows), moments)


def line(one: Finding, *, several: bool) -> str:
    """Write a finding in a line: rule, place, what, how often, and its frames."""
    frames = ""
    if one.frames:
        more = f" and {len(one.frames) - _FRAMES} more" if len(one.frames) > _FRAMES else ""
        frames = f"  frame{'s' if len(one.frames) > 1 else ''} {' '.join(map(str, one.frames[:_FRAMES]))}{more}"
    count = f"  {one.count}x" if one.count > 1 else ""
    place = wording.place(one, bus=several)
    return wording.safe(f"{one.rule} {place} {one.type}".strip() + f": {one.title}: {one.text}{count}{frames}")
