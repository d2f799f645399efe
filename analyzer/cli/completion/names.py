"""The names that a shell completes: types, fields, rules, pages and what else the program knows."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from analyzer.cli.help import topics
from analyzer.cli.usage.first_steps import SUFFIXES
from analyzer.filter.fields import FIXED
from analyzer.filter.names import FilterNames
from analyzer.report.comparison.model import KINDS
from analyzer.rules.catalogue import LAYERS, load
from analyzer.rules.gate import NEVER
from analyzer.simulate.faults import catalogue
from analyzer.stats.catalogue import STATISTICS
from analyzer.views.fields import field_names
from dissectors.keys.pages import CATEGORIES, ORIGINS, SEVERITIES
from dissectors.tmotor.traffic import FLIGHT_PLANS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.filter.fields import FieldRef
    from dissectors import Registry

# Of python-can; their own list would import all of it.
_DRIVERS = ("ixxat", "kvaser", "pcan", "serial", "slcan", "socketcan", "udp_multicast", "usb2can", "vector", "virtual")
_OTHER_SUFFIXES = ("txt", "csv", "bin")  # of captures, and of much else
_UNSAID = frozenset("'\"\\~$`")  # what shells would read as something else
_TABLES = ("all", "esc", "events", "findings", "frames", "transfers")


def names(registry: Registry) -> dict[str, tuple[str, ...]]:
    """Return the names of each kind, as the commands take them. Compiles every type the registry knows."""
    tables = registry.names()
    short = _short(tables)
    pages = load(registry)
    rules = (*pages, *LAYERS, *SEVERITIES)
    types = tuple(short[table] for table in tables)
    catalogue_ = list(FilterNames(registry).catalogue())
    packets = tuple(f"{short[table]}.{packet}" for table in tables for packet in _packets(registry, table))
    terms = tuple(_shortened((ref.name for ref in catalogue_), short))
    return {
        "types": types,
        "fields": tuple(_shortened(field_names(registry), short)),
        "terms": tuple(dict.fromkeys((*terms, *_alone(terms, packets)))),
        "values": tuple(_values(catalogue_, short, rules)),
        "rules": rules,
        "lexicon": (*pages, *LAYERS, *types),
        "tables": (*_TABLES, *types, *packets),
        "topics": tuple(topics()),
        "origins": tuple(ORIGINS),
        "flights": tuple(FLIGHT_PLANS),
        "scenarios": tuple(catalogue.stories()),
        "drivers": _DRIVERS,
        "gates": (*(f"{category}:{one}" for category in (*CATEGORIES, "any") for one in SEVERITIES), NEVER),
        "differences": ("any", *SEVERITIES, *KINDS, NEVER),
        "statistics": tuple(STATISTICS),
        "suffixes": (*(suffix[1:] for suffix in SUFFIXES), *_OTHER_SUFFIXES),
    }


def _short(tables: Sequence[str]) -> dict[str, str]:
    """Return the shortest name of each table that is of no other."""
    ends = Counter(table.rpartition(".")[2].lower() for table in tables)
    ends.update(table.lower() for table in tables if "." not in table)
    last = {table: table.rpartition(".")[2] for table in tables}
    return {table: name if ends[name.lower()] == 1 + (name == table) else table for table, name in last.items()}


def _shortened(fields: Iterable[str], short: dict[str, str]) -> Iterator[str]:
    for field in fields:
        words = field.split(".")
        table = next((t for n in range(len(words) - 1, 0, -1) if (t := ".".join(words[:n])) in short), "")
        yield short[table] + field.removeprefix(table) if table else field


def _alone(terms: Iterable[str], packets: Iterable[str]) -> Iterator[str]:
    """Yield the names of packets and their fields without the message that they lie in."""
    inside = frozenset(packets)
    for term in terms:
        carrier, _, rest = term.partition(".")
        if f"{carrier}.{rest.partition('.')[0]}" in inside:
            yield rest


def _values(refs: Sequence[FieldRef], short: dict[str, str], rules: Sequence[str]) -> Iterator[str]:
    """Yield `FIELD=VALUE` for what fields can be compared with in words, a blank of it as `~`.

    Fields are called by their whole names, and by type or packet and last part.
    """
    said = {"dronecan.type": tuple(short.values()), "finding.rule": rules}
    known: dict[str, dict[str, None]] = {}
    for ref, name in zip(refs, _shortened((ref.name for ref in refs), short), strict=True):
        words = said.get(name, [texts[0] for texts in ref.kind.texts.values()])
        parts = name.split(".")
        ways = {name} if name in FIXED else {name, f"{parts[0]}.{parts[-1]}", ".".join(parts[-2:])}
        for called in sorted(ways) if words else ():
            known.setdefault(called, {}).update(dict.fromkeys(words))
    for called, values in known.items():
        for word in values:
            if word and not set(word) & _UNSAID:
                yield f"{called}={word.replace(' ', '~')}"


def _packets(registry: Registry, table: str) -> list[str]:
    packets = registry.resolve(table).packets
    return [packet.name for packet in packets.packets] if packets else []
