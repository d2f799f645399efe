"""The vehicle that somebody expects: a TOML file with its nodes, numbers, severities, waivers and demands.

Mistakes are `ProfileError` with file and line. A capture of another vehicle (nodes, rates, ESCs, units) fails, one that
shows less than `require` is not judged. What a vehicle file can hold:

    bit_rate = 1000000
    escs = 6
    [node.11]                 # by node ID: a label instead of the channel, messages per second by type
    label = "front left"
    rates = { ESCStatus = 50 }
    [unit]                    # power unit of a packet = node ID
    0xA1 = 11
    [rule.BUS-001]            # severity, enabled, and the numbers of its page
    limit_per_s = 2000
    [rule.ACME-001]           # one of its own: see `own`
    title = "An ESC gets too hot"
    when = "ESCStatus.temperature_celsius > 100"
    [[waiver]]                # reason, owner and expires are a must; node and type narrow it down
    rule = "TRF-016"
    reason = "logger drops frames while it rotates files"
    owner = "bench team"
    expires = 2027-01-31
    [require]                 # else the capture is not judged
    types = ["ESCStatus"]
    rules = ["TRF-010"]
    escs = 6
    running_s = 30
"""

from __future__ import annotations

from datetime import date, datetime
from typing import TYPE_CHECKING, cast, get_args

from analyzer.facts.names import short
from analyzer.rules.vehicle.vocabulary import Vocabulary
from dissectors.kit import Severity
from dissectors.records import dataclass, field, replace
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from analyzer.rules.catalogue import Page
    from analyzer.rules.settings import Settings
    from analyzer.rules.vehicle.own import OwnRules
    from dissectors import Registry
    from dissectors.toml_table import TomlTable

MOST_BIT_RATE = 8_000_000
MOST_ESCS = 32  # where no profile says how many there can be
MOST_NODE = 127
TOLERANCE = 0.1  # of an expected rate
OWN_KEYS = frozenset(("when", "then", "for", "within"))  # of a rule that the file brings


@dataclass(frozen=True, slots=True)
class ExpectedNode:
    """One node by its ID. `rates` are transfers per second by type, met within `TOLERANCE`."""

    node: int
    label: str
    rates: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Excuse:
    """A waiver: findings of `rule` (of one node or type, if named) do not count until the day `expires` is over."""

    rule: str
    node: int | None
    type: str
    reason: str
    owner: str
    expires: date

    def concerns(self, rule: str, node: int | None, type_: str) -> bool:
        """Return whether a finding is one of those that it was written for."""
        return self.rule == rule and self.node in (None, node) and self.type in ("", short(type_))

    def covers(self, rule: str, node: int | None, type_: str, today: date) -> bool:
        """Return whether it excuses a finding today."""
        return today <= self.expires and self.concerns(rule, node, type_)


@dataclass(frozen=True, slots=True)
class Demand:
    """Demands on a capture, without which it is not judged."""

    types: tuple[str, ...] = ()
    rules: tuple[str, ...] = ()
    escs: int | None = None
    running_s: float | None = None


@dataclass(frozen=True, slots=True)
class Expected:
    """A vehicle as its file describes it. `units` maps the number of a power unit to a node ID."""

    path: str
    name: str
    bit_rate: int | None
    escs: int | None
    nodes: Mapping[int, ExpectedNode]
    units: Mapping[int, int]
    numbers: Mapping[str, Mapping[str, float]]
    severities: Mapping[str, Severity]
    enabled: Mapping[str, bool]
    excuses: tuple[Excuse, ...]
    demand: Demand = field(default_factory=Demand)
    own: OwnRules | None = None

    def settings(self, asked: Settings, pages: Mapping[str, Page]) -> Settings:
        """Return what was asked for on top of what the file says."""
        select = asked.select
        if select is None and self.enabled:
            chosen = {rule: page.enabled for rule, page in pages.items()} | {**self.enabled}
            select = {rule for rule, wanted in chosen.items() if wanted}
        return replace(
            asked,
            select=select,
            numbers={**self.numbers, **asked.numbers},
            severities={**self.severities, **asked.severities},
            bit_rate=asked.bit_rate if asked.bit_rate is not None else self.bit_rate,
            own=self.own,
        )

    def excuse(self, rule: str, node: int | None, type_: str, today: date) -> Excuse | None:
        """Return the waiver that covers a finding, if any."""
        return next((one for one in self.excuses if one.covers(rule, node, type_, today)), None)


def load(path: Path, pages: Mapping[str, Page], registry: Registry) -> Expected:
    """Read a vehicle file; `pages` are the rules that there are, `registry` the types."""
    words = Vocabulary(registry)
    most = words.escs or MOST_ESCS
    table = read(path)
    rules = table.table("rule")
    nodes = {one.node: one for one in _nodes(table.table("node"), words)}
    own = _own(rules, pages, registry, {node: one.label for node, one in nodes.items() if one.label})
    built_in, pages = pages, {**pages, **({} if own is None else own.pages)}
    numbers, severities, enabled = _rules(rules, built_in, pages)
    made = Expected(
        path=str(path),
        name=table.string("name"),
        bit_rate=table.integer("bit_rate", 1, MOST_BIT_RATE),
        escs=table.integer("escs", 0, most),
        nodes=nodes,
        units=_units(table.table("unit"), words.units),
        numbers=numbers,
        severities=severities,
        enabled=enabled,
        excuses=tuple(_excuse(row, pages, words) for row in table.rows("waiver")),
        demand=_demand(table.table("require"), pages, words, most),
        own=own,
    )
    table.finish()
    return made


def _nodes(table: TomlTable, words: Vocabulary) -> Iterator[ExpectedNode]:
    for name in table.body:
        number = table.number(name)
        if not 1 <= number <= MOST_NODE:
            table.fail(f"a node ID from 1 to {MOST_NODE} is expected", name)
        body = table.table(name)
        rates = body.table("rates")
        named = {_named(rates, kind, kind, words.message): _rate(rates, kind) for kind in rates.body}
        yield ExpectedNode(number, body.string("label"), named)
        body.finish()


def _units(table: TomlTable, known: range | None) -> dict[int, int]:
    for name in table.body:
        if known is not None and table.number(name) not in known:
            table.fail(f"a power unit from 0x{known[0]:02X} to 0x{known[-1]:02X} is expected", name)
    return {table.number(name): table.integer(name, 1, MOST_NODE) or 0 for name in table.body}


def _named(table: TomlTable, key: str, name: str, read: Callable[[str], str]) -> str:
    """Return a name as the program knows it."""
    try:
        return read(name)
    except LookupError as error:
        table.fail(str(error.args[0]), key)


def _own(table: TomlTable, pages: Mapping[str, Page], registry: Registry, labels: Mapping[int, str]) -> OwnRules | None:
    """Return the rules that the file brings; None if it has no others than there are."""
    if all(name in pages and OWN_KEYS.isdisjoint(body) for name, body in table.body.items()):
        return None
    from analyzer.rules.vehicle.own import OwnRules, read_own  # noqa: PLC0415 - filters are for those who write some

    return OwnRules(read_own(table, pages, registry, OWN_KEYS, set(labels.values())), labels)


def _rules(
    table: TomlTable, built_in: Mapping[str, Page], pages: Mapping[str, Page]
) -> tuple[dict[str, dict[str, float]], dict[str, Severity], dict[str, bool]]:
    numbers: dict[str, dict[str, float]] = {}
    severities: dict[str, Severity] = {}
    enabled: dict[str, bool] = {}
    for rule in table.body:
        _known(table, rule, rule, pages)
        if rule not in built_in:
            continue
        body = table.table(rule)
        severity = body.one_of("severity", get_args(Severity))
        if severity:
            severities[rule] = cast("Severity", severity)
        if "enabled" in body.body:
            enabled[rule] = body.flag("enabled")
        given = {name: _rate(body, name, usual) for name, usual in pages[rule].settings.items() if name in body.body}
        if given:
            numbers[rule] = given
        body.asked.update(pages[rule].settings, ("enabled",))
        body.finish()
    return numbers, severities, enabled


def _excuse(row: TomlTable, pages: Mapping[str, Page], words: Vocabulary) -> Excuse:
    rule = row.string("rule", required=True)
    _known(row, "rule", rule, pages)
    expires = row.take("expires", date, "a day like 2027-01-31")
    if expires is None:
        row.fail("expires is missing")
    made = Excuse(
        rule=rule,
        node=row.integer("node", 1, MOST_NODE),
        type=_named(row, "type", kind, words.covered) if (kind := row.string("type")) else "",
        reason=row.string("reason", required=True),
        owner=row.string("owner", required=True),
        expires=expires.date() if isinstance(expires, datetime) else expires,
    )
    row.finish()
    return made


def _demand(table: TomlTable, pages: Mapping[str, Page], words: Vocabulary, most: int) -> Demand:
    rules = table.strings("rules")
    for rule in rules:
        _known(table, "rules", rule, pages)
    running = table.fraction("running_s")
    made = Demand(
        types=tuple(_named(table, "types", name, words.table) for name in table.strings("types")),
        rules=rules,
        escs=table.integer("escs", 0, most),
        running_s=None if running is None else float(running),
    )
    table.finish()
    return made


def _known(table: TomlTable, key: str, rule: str, pages: Mapping[str, Page]) -> None:
    if rule not in pages:
        import difflib  # noqa: PLC0415 - only a mistyped name is worth it

        near = difflib.get_close_matches(rule, pages, n=3)
        table.fail(f"no rule is called {rule!r:.60}" + (f" (near: {', '.join(near)})" if near else ""), key)


def _rate(table: TomlTable, name: str, usual: float = 0) -> float:
    """Return a number; one below 0 only in place of another one below 0."""
    value = table.fraction(name)
    if value is None or (value < 0 and usual >= 0):
        table.fail("a number from 0 on is expected", name)
    return float(value)
