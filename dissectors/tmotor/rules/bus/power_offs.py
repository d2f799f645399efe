"""ESCs that are switched off together once their motors stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.kit import NO_TIME, SECOND, Occurrence, Pauses, Rule
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, esc_reports, last_reports

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

_FEWEST = 2  # ESCs: one alone may have failed


class _Report(NamedTuple):
    """The last report of an ESC: time, whether its motor stood, and its frames with their lines."""

    t: int
    stands: bool
    frames: tuple[int, ...]
    lines: tuple[str, ...]


class PowerOffs(Rule):
    """Remembers the last report of each ESC; they are compared at the end."""

    rules = ("BUS-042",)

    def __init__(self) -> None:
        self._last: dict[ReportingEsc, _Report] = {}
        self._pauses = Pauses(SECOND)

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Note the last reports of a batch."""
        self._pauses.feed(view)
        reports = esc_reports(view)
        if reports is not None and view.start != NO_TIME:
            last, evidence = reports.first[1:] - 1, last_reports(view)
            columns = reports.t[last].tolist(), reports.column("rpm")[last].tolist()
            for esc, t, rpm in zip(reports.escs, *columns, strict=True):
                if esc in self._last or len(self._last) < MOST_UNITS:
                    self._last[esc] = _Report(t, not rpm, *evidence[esc])
        yield from ()

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield an event for each ESC of a bus if all of them fell silent together, and none turned or goes on."""
        together, silence = (round(view.number("BUS-042", name) * SECOND) for name in ("together_s", "silence_s"))
        for bus, end in self._pauses.last.items():
            latest = max((report.t for unit, report in self._last.items() if unit.bus == bus), default=end)
            off = {
                unit: report for unit, report in self._last.items() if unit.bus == bus and report.t >= latest - together
            }
            nodes = {unit.node for unit in off}
            if end - latest < silence or len(nodes) < _FEWEST or not all(report.stands for report in off.values()):
                continue
            values = {"escs": len(off), "seconds": (end - latest) / SECOND}
            for unit, report in off.items():
                yield Occurrence(
                    "BUS-042", report.t, bus, unit.node, "ESCStatus", report.frames, values, lines=report.lines
                )
