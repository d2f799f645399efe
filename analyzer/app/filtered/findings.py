"""Findings of captures that a filter selects: those with an occurrence that names a frame of a matching row."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.app.filtered.frames import MatchingFrames, matching_frames
from analyzer.rules.named_frames import NamedFrames
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.app.run import Run
    from analyzer.report.model import Finding, Report


class MatchingFindings:
    """Remembers of each capture which frames match and which ones the rules name."""

    def __init__(self) -> None:
        self._captures: dict[str, tuple[MatchingFrames, NamedFrames, Mapping[str, int]]] = {}

    def judging(self, run: Run, label: str) -> tuple[NamedFrames | None, dict[str, int]]:
        """Find what matches in the captures of a run, called `label`, that is then judged.

        Returns what takes the frames that rules name, None without a filter, and a dictionary that is to hold the
        places of the interfaces afterwards. Raises what a wrong filter raises.
        """
        matching = matching_frames(run)
        return (None, {}) if matching is None else self.know(matching, label)

    def know(self, matching: MatchingFrames, label: str) -> tuple[NamedFrames, dict[str, int]]:
        """Take what matches in captures, called `label`, that are judged now; returns what `judging` returns."""
        named, buses = NamedFrames(), dict[str, int]()
        self._captures[label] = matching, named, buses
        return named, buses

    def cut(self, report: Report) -> Report:
        """Return the report with the findings that match; verdicts and gate stay those of all."""
        return replace(report, findings=tuple(one for one in report.findings if self._holds(one)))

    def _holds(self, finding: Finding) -> bool:
        if finding.capture not in self._captures:
            return False
        matching, named, buses = self._captures[finding.capture]
        places = [number - 1 for number in finding.frames]
        ends = [place.frame - 1 for place in (finding.first, finding.last) if place.frame is not None]
        if ends:
            every = named.frames_of(finding.rule, buses.get(finding.bus, -1), finding.node)
            places += every[(every >= min(ends)) & (every <= max(ends))].tolist()
        return bool(matching.holds(np.array(places, np.int64)).any())
