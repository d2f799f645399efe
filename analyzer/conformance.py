"""Captures under all rules, for Python: `check` gives the report that the command `tailbyte check` shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from os import PathLike, fspath
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import dissectors
from analyzer.ahead import ahead
from analyzer.engine import Engine
from analyzer.facts.dialects import checked
from analyzer.report import vehicle
from analyzer.report.baseline import Baseline
from analyzer.report.build import Order, Taken, build
from analyzer.rules.catalogue import ORIGINS, load, matching
from analyzer.rules.checking import Check
from analyzer.rules.expected import load as load_vehicle
from analyzer.rules.gate import DEFAULT, FailOn
from analyzer.rules.settings import Settings
from analyzer.sources import CaptureError
from analyzer.sources.merge import Plan, open_captures

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from analyzer.engine import Totals
    from analyzer.report.build import Demand, Excuses, Revise
    from analyzer.report.model import Report
    from analyzer.rules.catalogue import Page
    from analyzer.rules.expected import Expected
    from analyzer.sources import Source
    from analyzer.sources.merge import Merged
    from dissectors import Registry

Name = str | PathLike[str]


@dataclass(frozen=True, slots=True)
class Choice:
    """Rules by name, layer or `all`, as somebody asks for them. `origins` leaves only rules that these state."""

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()

    def rules(self, pages: Mapping[str, Page]) -> tuple[Collection[str] | None, Collection[str]]:
        """`select` and `ignore` of `Settings`. Raises `LookupError`, or `ValueError` if nothing is left."""
        for origin in self.origins:
            if origin not in ORIGINS:
                raise ValueError(f"no rule has the origin {origin!r} (one of: {', '.join(ORIGINS)})")
        select = matching(self.select, pages) if self.select else None
        ignore = matching(self.ignore, pages)
        if self.origins:
            of = {rule for rule, page in pages.items() if page.origin in self.origins}
            select = {rule for rule in of if (pages[rule].enabled if select is None else rule in select)}
        if not Settings(select=select, ignore=ignore).enabled(pages):
            raise ValueError("no rule is left")
        return select, ignore

    def asked(self) -> dict[str, list[str]]:
        """What was asked for, to be printed."""
        words = {"select": self.select, "ignore": self.ignore, "origin": self.origins}
        return {name: list(given) for name, given in words.items() if given}


def check(
    paths: Name | Sequence[Name],
    *,
    select: Iterable[str] = (),
    ignore: Iterable[str] = (),
    origins: Iterable[str] = (),
    fail_on: str = DEFAULT,
    bit_rate: int | None = None,
    dialects: Mapping[int, Collection[str]] | None = None,
    same_bus: bool = False,
    dissectors_: Sequence[Path] = (),
    profile: Name | None = None,
    baseline: Name | None = None,
) -> Report:
    """Judges captures one by one, or as recordings of one bus with `same_bus`.

    Args:
        paths: captures of any format.
        select: rules or layers instead of those that are on by default.
        ignore: rules or layers that are left out.
        origins: only rules that these state: document, implied, dronecan, heuristic.
        fail_on: what fails the gate, like `protocol:error,device:warning`, or `never`.
        bit_rate: bits per second of the bus.
        dialects: readings of doubtful fields by node ID, against the node's own data.
        same_bus: merge the captures and leave out what repeats.
        dissectors_: folders with further data types.
        profile: a vehicle file; what is given here as an argument goes before it.
        baseline: the JSON of an older report, to tell what is new.

    A capture that cannot be read is in the report, as damage. Raises `LookupError` for an unknown rule and `ValueError`
    for other arguments that make no sense (`ProfileError` and `BaselineError` are such).
    """
    names = [fspath(path) for path in ([paths] if isinstance(paths, (str, PathLike)) else paths)]
    if not names:
        raise ValueError("no capture is given")
    registry = dissectors.load(dissectors_)
    pages = load(registry)
    choice = Choice(tuple(select), tuple(ignore), tuple(origins))
    selected, ignored = choice.rules(pages)
    settings = Settings(select=selected, ignore=ignored, bit_rate=bit_rate, dialects=checked(dialects or {}, registry))
    expected = None if profile is None else load_vehicle(Path(fspath(profile)), pages, registry)
    if expected is not None:
        settings = expected.settings(settings, pages)
    older = None if baseline is None else Baseline.load(Path(fspath(baseline)))
    groups = [names] if same_bus else [[name] for name in names]
    taken = [
        _take(group, label, registry, settings, same_bus) for group, label in zip(groups, ids(groups), strict=True)
    ]
    asked = choice.asked() | ({} if baseline is None else {"baseline": fspath(baseline)})
    return build(taken, registry, pages, settings, order(FailOn.parse([fail_on]), asked, expected, older))


def order(fail_on: FailOn, asked: Mapping[str, object], expected: Expected | None, older: Baseline | None) -> Order:
    """What is asked of a report, with what a vehicle file and an older report say; waivers count by today's date."""
    revise: list[Revise] = []
    demands: list[Demand] = []
    excuses: list[Excuses] = []
    if expected is not None:
        today = date.today()  # noqa: DTZ011 - the day where somebody reads it
        revise.append(vehicle.revision(expected, today))
        demands.append(vehicle.demand(expected))
        excuses.append(vehicle.excuses(expected, today))
    if older is not None:
        revise.append(lambda draft: replace(draft, findings=older.compare(draft.findings, draft.captures)))
    profile = "" if expected is None else expected.name or expected.path
    return Order(tool(), fail_on, asked, profile, revise, demands, excuses)


def ids(groups: Sequence[Sequence[str]]) -> list[str]:
    """Short names for captures, none of them twice: the last part of the path if that tells them apart."""
    short = ["+".join(PurePath(name).name or name for name in group) for group in groups]
    whole = ["+".join(group) for group in groups]
    found: list[str] = []
    for k, name in enumerate(short):
        wanted = name if short.count(name) == 1 else whole[k]
        found.append(wanted if wanted not in found else f"{wanted} ({k + 1})")
    return found


def tool() -> str:
    """Name and version of the program."""
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - not needed to look at captures

    try:
        return f"tailbyte {version('tailbyte')}"
    except PackageNotFoundError:
        return "tailbyte"


def damage_of(source: Source | Merged, totals: Totals) -> str:
    """What of a capture could not be read, after the reading."""
    found = [reason_of(part.damage, part.name) for part in source.parts if part.damage is not None]
    if unreadable := totals.lines.get("unreadable", 0):
        found.append(f"{unreadable} of {totals.lines['lines']} lines or records unreadable")
    if not totals.balanced:
        found.append("lines and frames do not add up")
    return "; ".join(found)


def reason_of(error: CaptureError, name: str) -> str:
    """The error without the name of the capture, which stands beside it."""
    return str(error).removeprefix(f"{name}: ")


def _take(names: Sequence[str], label: str, registry: Registry, settings: Settings, same_bus: bool) -> Taken:
    source = open_captures(names, Plan(same_bus=same_bus))
    for part in source.parts:
        part.hashed = True
    engine, checking, unopened = Engine(registry), Check(registry, settings), ""
    try:
        for measured in ahead(checking.measured(engine.run(source.chunks()))):
            checking.feed(measured)
    except CaptureError as error:
        unopened = reason_of(error, names[0])
    return Taken(
        id=label,
        path=names[0],
        checked=checking.finish(source.parts, engine),
        damage=unopened or damage_of(source, engine.totals),
        unopened=bool(unopened),
        live=source.live,
        arguments=(*names[1:], "--same-bus") if same_bus else (),
    )
