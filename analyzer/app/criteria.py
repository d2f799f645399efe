"""The criteria for captures and live buses: the rules chosen, the expected vehicle, an older report, the gate."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.version import UNKNOWN, version
from analyzer.facts.dialects import checked
from analyzer.report import vehicle
from analyzer.report.baseline import Baseline
from analyzer.report.build import build
from analyzer.report.draft import ReportOptions
from analyzer.rules.catalogue import load
from analyzer.rules.gate import DEFAULT, FailOn
from analyzer.rules.vehicle.expected import load as load_vehicle
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.app.request import RuleChoice
    from analyzer.report.draft import Demand, Excuses, JudgedCapture, Revise
    from analyzer.report.model import Report
    from analyzer.rules.settings import Settings
    from analyzer.window.limits import Window
    from dissectors import Registry


class Criteria:
    """The meaning of a choice of rules with these data types, checked before anything is read.

    Raises `LookupError` for an unknown rule, `ValueError` for whatever else makes no sense (`ProfileError` and
    `BaselineError` are such) and `OSError` for files that cannot be read. `complaints` are lines about waivers that
    are over, and about Python that does not run.
    """

    def __init__(self, choice: RuleChoice, registry: Registry) -> None:
        self.registry, self.pages = registry, load(registry)
        self.choice = choice
        self._fail_on = FailOn.parse(choice.fail_on or [DEFAULT])
        self._today = date.today()  # noqa: DTZ011 - the day where somebody reads it
        self.complaints: list[str] = [
            f"{profile.folder}: its rules in Python ({profile.code}) do not run without --trust-dissector"
            for profile in registry.profiles
            if profile.muted
        ]
        self._expected = None
        if choice.vehicle is not None:
            self._expected = load_vehicle(Path(choice.vehicle), self.pages, registry)
            if self._expected.own is not None:
                self.pages = {**self.pages, **self._expected.own.pages}
            self.complaints += vehicle.expired(self._expected, self._today)
        self.settings = replace(choice.settings(self.pages), dialects=checked(choice.readings(), registry))
        if self._expected is not None:
            self.settings = self._expected.settings(self.settings, self.pages)
        self._older = None if choice.baseline is None else Baseline.load(Path(choice.baseline))

    def settings_of(self, window: Window) -> Settings:
        """Return the settings for a window; one that leaves off the end has no rules that ask how a recording ends."""
        asking = {rule for rule, page in self.pages.items() if "end" in page.inconclusive and window.leaves_off}
        return replace(self.settings, ignore={*self.settings.ignore, *asking}, cut_in=window.cuts_in)

    @property
    def labels(self) -> dict[int, str]:
        """The labels of nodes in the vehicle file, by node ID."""
        nodes = {} if self._expected is None else self._expected.nodes
        return {node: one.label for node, one in nodes.items() if one.label}

    def revisions(self) -> Sequence[Revise]:
        """Return what the vehicle file has to say of findings, before there is a report."""
        return [] if self._expected is None else [vehicle.revision(self._expected, self._today)]

    def report(self, taken: Sequence[JudgedCapture], window: str = "") -> Report:
        """Build the report of captures that were judged with `settings`; `window` is the one that was asked for."""
        asked = self.choice.asked() | ({"window": window} if window else {})
        expected, older = self._expected, self._older
        revise = list(self.revisions())
        demands: list[Demand] = []
        excuses: list[Excuses] = []
        if expected is not None:
            demands.append(vehicle.demand(expected))
            excuses.append(vehicle.excuses(expected, self._today))
        if older is not None:
            revise.append(lambda draft: replace(draft, findings=older.compare(draft.findings, draft.captures)))
        name = "" if expected is None else expected.name or expected.path
        known = version()
        tool = "tailbyte" if known == UNKNOWN else f"tailbyte {known}"
        order = ReportOptions(tool, self._fail_on, self.choice.least, asked, name, revise, demands, excuses)
        return build(taken, self.registry, self.pages, self.settings, order)
