"""What captures and live buses are judged by: rules, limits and the expected vehicle, as arguments ask for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import options, streams

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.report.baseline import Baseline
    from analyzer.report.build import Revise, Taken
    from analyzer.report.model import Report
    from analyzer.rules.catalogue import Page
    from analyzer.rules.expected import Expected
    from analyzer.rules.gate import FailOn
    from dissectors import Registry


def add_rules(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Which rules, with which limits, and what fails."""
    group = parser.add_argument_group("rules", "RULES: TRF-010, a layer (CAN, TRF, TYP, PUSH, BUS, CAP), or all")
    for name, text in (("select", "only these, also those that are off by default"), ("ignore", "all but these")):
        group.add_argument(
            f"--{name}", action="append", default=[], metavar="RULES", help=f"{text}; comma-separated, repeatable"
        )
    group.add_argument(
        "--origin", action="append", default=[], metavar="ORIGIN",
        help="only rules that these state: document, implied (by it), dronecan, heuristic",
    )  # fmt: skip
    group.add_argument(
        "--fail-on", action="append", default=[], metavar="CATEGORY:SEVERITY",
        help="what exit status 1 is for: protocol, device, capture or any; error, warning or note; comma-separated; "
        "or never (default: protocol:error)",
    )  # fmt: skip
    group.add_argument("--profile", metavar="FILE.toml", help="what is expected of the vehicle, with its own limits")
    group.add_argument("--baseline", metavar="OLD.json", help="an older --json: what it has already does not fail")
    options.add_dialect(group)
    return group


class Judging:
    """What the arguments ask for, checked before anything is read.

    Raises `LookupError` for an unknown rule and `ValueError` for whatever else makes no sense; `who` complains of
    waivers that are over.
    """

    def __init__(self, args: argparse.Namespace, who: str) -> None:
        from analyzer.conformance import Choice  # noqa: PLC0415
        from analyzer.rules.catalogue import load  # noqa: PLC0415
        from analyzer.rules.gate import DEFAULT, FailOn  # noqa: PLC0415
        from analyzer.rules.settings import Settings  # noqa: PLC0415

        self._args = args
        self._fail_on: FailOn = FailOn.parse(args.fail_on or [DEFAULT])
        self.registry: Registry = options.registry(args)
        self.pages: Mapping[str, Page] = load(self.registry)
        origins = tuple(word.lower() for word in _words(args.origin))
        self._choice = Choice(_words(args.select), _words(args.ignore), origins)
        select, ignore = self._choice.rules(self.pages)
        dialects = options.dialects(args, self.registry)
        self.settings = Settings(select=select, ignore=ignore, bit_rate=args.bitrate, dialects=dialects)
        self._expected: Expected | None = None
        self._older: Baseline | None = None
        if args.profile is not None:
            self._expect(args.profile, who)
        if args.baseline is not None:
            from analyzer.report.baseline import Baseline  # noqa: PLC0415

            self._older = Baseline.load(Path(args.baseline))

    def revisions(self) -> Sequence[Revise]:
        """What the vehicle file has to say of findings, before there is a report."""
        from analyzer.conformance import order  # noqa: PLC0415

        return order(self._fail_on, {}, self._expected, None).revise

    def build(self, taken: Sequence[Taken], window: str = "") -> Report:
        """The report of captures that were judged with `settings`; `window` is the one that was asked for."""
        from analyzer.conformance import order  # noqa: PLC0415
        from analyzer.report.build import build  # noqa: PLC0415

        asked: dict[str, object] = dict(self._choice.asked())
        if self._args.dialect:
            asked["dialects"] = [f"{node}={choice}" for node, choice in self._args.dialect]
        if self._args.baseline is not None:
            asked["baseline"] = self._args.baseline
        if window:
            asked["window"] = window
        told = order(self._fail_on, asked, self._expected, self._older)
        return build(taken, self.registry, self.pages, self.settings, told)

    def _expect(self, path: str, who: str) -> None:
        """The vehicle file; a waiver that is over is told of."""
        from datetime import date  # noqa: PLC0415

        from analyzer.report.vehicle import expired  # noqa: PLC0415
        from analyzer.rules.expected import load  # noqa: PLC0415

        self._expected = load(Path(path), self.pages, self.registry)
        self.settings = self._expected.settings(self.settings, self.pages)
        for line in expired(self._expected, date.today()):  # noqa: DTZ011 - the day where somebody reads it
            streams.complain(line, who)


def _words(given: Iterable[str]) -> tuple[str, ...]:
    return tuple(word.strip() for text in given for word in text.split(",") if word.strip())
