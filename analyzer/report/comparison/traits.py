"""The traits of one capture that are compared: taken in one pass, beside the rules."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from analyzer.devices.escs import Escs
from analyzer.report.comparison.beginning import FrameBlocks
from analyzer.report.comparison.clock import BelievedTimes
from analyzer.report.comparison.identity import Identities
from analyzer.report.comparison.limits import limits
from analyzer.report.comparison.losses import FirstLosses
from analyzer.report.comparison.parameters import Parameters
from analyzer.report.comparison.rhythm import Rhythms
from analyzer.report.comparison.samples import EscSamples
from analyzer.rules.catalogue import load
from analyzer.rules.judge import Judge
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.facts.summary import Facts
    from analyzer.flight.verdict.model import Triage
    from analyzer.report.model import CaptureSummary, Report
    from analyzer.rules.settings import Settings
    from dissectors import Registry

_SHARED = "BUS-010"
_LOSSY = "CAP-006"


class Traits:
    """Adds up the batches of one capture. Raises `ProfileError` for a wrong `plots.toml`.

    Args:
        registry: the types that the capture is decoded with.
        settings: what it is judged by. What losses and rates depend on is judged here if nobody looks for it.
    """

    def __init__(self, registry: Registry, settings: Settings) -> None:
        self.clock = BelievedTimes()
        self.blocks = FrameBlocks()
        self.rhythms = Rhythms(self.clock)
        self.losses = FirstLosses()
        self.identities = Identities()
        self.parameters = Parameters(registry)
        self.samples = EscSamples(limits()["settled"])
        self._escs = Escs(registry)
        untold = {_SHARED, _LOSSY} - settings.enabled(load(registry)).keys()
        quiet = replace(settings, select=untold, ignore=(), severities={}, own=None)
        self._beside = Judge(registry, quiet) if untold else None

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self.clock.feed(batch)
        self.blocks.feed(batch)
        self.rhythms.feed(batch)
        self.losses.feed(batch)
        self.identities.feed(batch.messages)
        self.parameters.feed(batch)
        self.samples.feed(self._escs.feed(batch))
        if self._beside is not None:
            self._beside.feed(batch)

    @cached_property
    def untold(self) -> set[tuple[str, int, int]]:
        """Rule, bus and node of what the report leaves out, after the last batch."""
        runs = () if self._beside is None else self._beside.finish().runs
        return {(key.rule, key.bus, key.node) for key, _ in runs}


@dataclass(frozen=True, slots=True)
class MeasuredSide:
    """One capture after the last batch: its traits, its facts, and the report of the rules about it alone.

    `whole` says that no window left out its beginning or end.
    """

    traits: Traits
    facts: Facts
    report: Report
    whole: bool = True

    @property
    def capture(self) -> CaptureSummary:
        """The capture as the report has it."""
        return self.report.captures[0]

    @property
    def triage(self) -> Triage | None:
        """The answer of triage for its flights; None if nobody looked."""
        return self.report.triages[0] if self.report.triages else None

    @property
    def start(self) -> int | None:
        """The first time in ns that can be believed."""
        return self.traits.clock.start

    @property
    def end(self) -> int | None:
        """The last time in ns that can be believed."""
        return self.traits.clock.end

    @property
    def timed(self) -> bool:
        """True if times say how much time went by."""
        return self.facts.judge["timing"] == "yes"

    @property
    def shared(self) -> set[tuple[str, int]]:
        """Buses and node IDs behind which two devices are: their transfer IDs do not tell what is missing."""
        names, found = self.facts.bus_names, self.report.findings
        told = {(one.bus, one.node) for one in found if one.rule == _SHARED and one.node is not None}
        return told | {(names[bus], node) for rule, bus, node in self.traits.untold if rule == _SHARED}

    @property
    def lost(self) -> int:
        """Transfers that are missing by their IDs, of all senders whose IDs tell."""
        shared = self.shared
        return sum(one.lost or 0 for one in self.facts.senders if (one.bus, one.node) not in shared)

    @property
    def incomplete(self) -> str:
        """Why less is in it than was sent; empty if nothing says so."""
        if self.capture.damage:
            return "it is damaged"
        if self.facts.lossy:
            return "its recorder lost frames"
        rules = {*(one.rule for one in self.report.findings), *(rule for rule, _, _ in self.traits.untold)}
        return "its recorder lost frames, as far as transfer IDs tell" if _LOSSY in rules else ""
