"""Options of the rules: which ones, with which limits, for which vehicle, and what fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.cli.arguments import options

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from analyzer.app.criteria import Criteria
    from analyzer.app.request import RuleChoice
    from analyzer.report.model import Report
    from dissectors import Registry


def add_rules(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add the choice of rules and limits, and of what fails."""
    group = add_choice(parser, "rules")
    group.add_argument(
        "--fail-on", action="append", default=[], metavar="CATEGORY:SEVERITY",
        help="what exit status 1 is for: protocol, device, capture or any; error, warning or note; comma-separated; "
        "or never (default: protocol:error,device:error)",
    )  # fmt: skip
    group.add_argument(
        "--least", action="append", default=[], metavar="KIND=N",
        help="what a capture must have to be judged, else exit status 4: transfers=20, seconds=1 are the defaults",
    )  # fmt: skip
    group.add_argument("--profile", action=options.OldName, dest="vehicle", new="--vehicle")
    group.add_argument("--baseline", metavar="OLD.json", help="an older --json: what it has already does not fail")
    return group


def add_choice(parser: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """Add the choice of rules and limits, in a group of that title."""
    group = parser.add_argument_group(title, "RULES: TRF-010, a layer (CAN, TRF, TYP, PUSH, BUS, CAP), or all")
    for name, text in (("select", "only these, also those that are off by default"), ("ignore", "all but these")):
        group.add_argument(
            f"--{name}", action="append", default=[], metavar="RULES", help=f"{text}; comma-separated, repeatable"
        )
    group.add_argument(
        "--origin", action="append", default=[], metavar="ORIGIN",
        help="only rules that these state: document, implied (by it), dronecan, heuristic, vehicle (its file)",
    )  # fmt: skip
    group.add_argument("--vehicle", metavar="FILE.toml", help="what is expected of the vehicle, with its own limits")
    options.add_dialect(group)
    return group


def choice(args: argparse.Namespace) -> RuleChoice:
    """Return the rules and limits that the arguments of `add_rules` or `add_choice` ask for."""
    from analyzer.app.request import RuleChoice  # noqa: PLC0415
    from analyzer.rules.gate import Least  # noqa: PLC0415

    return RuleChoice(
        select=_words(args.select),
        ignore=_words(args.ignore),
        origins=tuple(word.lower() for word in _words(args.origin)),
        fail_on=tuple(getattr(args, "fail_on", ())),
        least=Least.parse(getattr(args, "least", ())),
        bit_rate=args.bitrate,
        dialects=tuple(args.dialect),
        vehicle=args.vehicle,
        baseline=getattr(args, "baseline", None),
    )


def criteria(chosen: RuleChoice, registry: Registry, who: str) -> Criteria:
    """Return what the choice means; `who` complains of what does not count or run. Raises what `Criteria` raises."""
    from analyzer.app.criteria import Criteria  # noqa: PLC0415

    found = Criteria(chosen, registry)
    for line in found.complaints:
        streams.complain(line, who)
    return found


def _words(given: Iterable[str]) -> tuple[str, ...]:
    return tuple(word.strip() for text in given for word in text.split(",") if word.strip())


def tell_gate(chosen: RuleChoice, report: Report) -> None:
    """Say how to get the gate of earlier versions where only errors of devices have failed the one by default."""
    failing = {finding.category for finding in report.findings if finding.fails}
    if failing == {"device"} and not chosen.fail_on:
        streams.tell("note: errors of devices fail by default now; --fail-on protocol:error is the gate of before\n")
