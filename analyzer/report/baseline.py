"""An older report as the measure: what is new, what has become worse, what was known.

Captures differ in length, so counts say nothing: an occurrence is counted per transfer of its session (bus, node and
type), or per frame of its bus where no session is to blame. What is about transfers that never came is counted per
transfer of its node, or per frame.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from analyzer.report.model import SCHEMA
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from analyzer.report.model import CaptureSummary, Finding

MOST_BYTES = 256 * 1024 * 1024
_TOLERANCE = 1.1  # times the old rate is not worse yet
_SIGMAS = 3.0  # nor is what chance explains

Session = tuple[str, int | None, str]
Trouble = tuple[str, str, int | None, str, str]

ALL: Session = ("", None, "")  # the frames of every bus


class BaselineError(ValueError):
    """A file that is no report to compare with; the text names it and the reason."""


class Baseline:
    """The findings of an older report, by rule, bus, node, type and key."""

    def __init__(self, counts: Counter[Trouble], sizes: Counter[Session]) -> None:
        self._counts = counts
        self._sizes = sizes

    @classmethod
    def load(cls, path: Path) -> Baseline:
        """Read the JSON of an older run. Raises `BaselineError`."""
        try:
            with path.open("rb") as stream:
                data = stream.read(MOST_BYTES + 1)
            if len(data) > MOST_BYTES:
                raise BaselineError(f"{path}: larger than {MOST_BYTES} bytes")
            old = json.loads(data)
        except OSError as error:
            raise BaselineError(f"{path}: {error.strerror or 'cannot be read'}") from None
        except RecursionError:
            raise BaselineError(f"{path}: nested too deeply") from None
        except UnicodeDecodeError:
            raise BaselineError(f"{path}: no JSON text") from None
        except json.JSONDecodeError as error:
            raise BaselineError(f"{path}: line {error.lineno}: {error.msg}") from None
        if not isinstance(old, dict) or old.get("schema") != SCHEMA:
            raise BaselineError(f"{path}: no report of the form {SCHEMA}")
        try:
            return cls(_old_counts(old), _old_sizes(old))
        except (AttributeError, KeyError, TypeError, ValueError):
            raise BaselineError(f"{path}: a damaged report") from None

    def compare(self, findings: Iterable[Finding], captures: Sequence[CaptureSummary]) -> tuple[Finding, ...]:
        """Return the findings, each marked as new, worse or known."""
        found = tuple(findings)
        counts: Counter[Trouble] = Counter()
        for finding in found:
            counts[_trouble(finding)] += finding.count
        sizes = Counter(dict(_sizes(captures)))
        marks: dict[Trouble, Any] = {
            trouble: self._mark(trouble, count, self._times(trouble[1:4], sizes)) for trouble, count in counts.items()
        }
        return tuple(replace(finding, baseline=marks[_trouble(finding)]) for finding in found)

    def _times(self, session: Session, sizes: Counter[Session]) -> float:
        """Return how many times as much was sent of the least that holds the session and that both reports saw."""
        bus, node, _ = session
        for wider in (session, (bus, node, ""), (bus, None, ""), ALL):
            if sizes[wider] and self._sizes[wider]:
                return sizes[wider] / self._sizes[wider]
        return 1.0

    def _mark(self, trouble: Trouble, count: int, times: float) -> str:
        before = self._counts[trouble]
        if not before:
            return "new"
        expected = before * times
        # A capture of the same session that gives the same rate is never worse, whatever rounding does.
        return "worse" if count > expected * _TOLERANCE + _SIGMAS * math.sqrt(expected) else "known"


def _trouble(finding: Finding) -> Trouble:
    return (finding.rule, finding.bus, finding.node, finding.type, finding.key)


def _sizes(captures: Iterable[CaptureSummary]) -> Iterator[tuple[Session, int]]:
    found: Counter[Session] = Counter()
    for capture in captures:
        for bus in capture.buses:
            found[bus.name, None, ""] += bus.frames
            found[ALL] += bus.frames
        for node in capture.nodes:
            for kind, count in node.types.items():
                found[node.bus, node.node, kind] += count
                found[node.bus, node.node, ""] += count
    yield from found.items()


def _old_counts(old: dict[str, Any]) -> Counter[Trouble]:
    counts: Counter[Trouble] = Counter()
    for row in old["findings"]:
        trouble = (row["rule"], row["bus"], row["node"], row["type"], row["key"])
        counts[trouble] += int(row["count"])
    return counts


def _old_sizes(old: dict[str, Any]) -> Counter[Session]:
    sizes: Counter[Session] = Counter()
    for capture in old["captures"]:
        for bus in capture["buses"]:
            sizes[bus["name"], None, ""] += int(bus["frames"])
            sizes[ALL] += int(bus["frames"])
        for node in capture["nodes"]:
            for kind, count in node["types"].items():
                sizes[node["bus"], node["node"], kind] += int(count)
                sizes[node["bus"], node["node"], ""] += int(count)
    return sizes
