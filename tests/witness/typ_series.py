"""Proofs of TYP-401 to TYP-504: what ParamGet remembers, and the numbers of PUSHSCI and PUSHCAN."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING

from witness.views import Finder, Found, Message, by_node, messages, prefixed, where

if TYPE_CHECKING:
    from collections.abc import Callable

    from witness.reader import Log

COUNTERS = ("esc_startup_times", "esc_startup_duration", "esc_error_count")
PUSHES = ("PUSHSCI", "PUSHCAN")


def reserved(log: Log) -> Found:
    """TYP-401: a reserved block that is neither left out nor 32 bytes."""
    return where(log, ("ParamGet",), lambda one: len(one["rsvd"]) not in {0, 32} and not prefixed(one))


def backwards(log: Log) -> Found:
    """TYP-402: a lifetime counter is lower than in the ParamGet of that UUID before."""
    found, before = [], {}
    for one in messages(log, "ParamGet"):
        last = before.get(one["esc_uuid"])
        if last is not None and any(one[name] < last[name] for name in COUNTERS):
            found.append(one.numbers)
        before[one["esc_uuid"]] = one
    return found


def identity(log: Log) -> Found:
    """TYP-403: a UUID that another node had first, or a node and index that had another UUID first."""
    found = []
    owners: dict[int, int] = {}
    uuids: dict[tuple[int, int], int] = {}
    for one in messages(log, "ParamGet"):
        uuid, place = one["esc_uuid"], (one.src, one["esc_index"])
        if owners.setdefault(uuid, one.src) != one.src or uuids.setdefault(place, uuid) != uuid:
            found.append(one.numbers)
    return found


def calendar(value: int) -> bool:
    """Is it a date as YYYYMMDD, 1990 to 2099?"""
    try:
        return 1990 <= datetime(value // 10_000, value // 100 % 100, value % 100, tzinfo=UTC).year <= 2099
    except ValueError:
        return False


def date_format(log: Log) -> Found:
    """TYP-404: a production date that is no YYYYMMDD, so that it is Unix seconds or unknown."""
    return where(log, ("ParamGet",), lambda one: not calendar(one["esc_product_date"]))


def _sequence(wrong: Callable[[Message, Message], bool]) -> Finder:
    """Pairs of transfers in a row of one node and type whose sequence numbers are wrong."""

    def find(log: Log) -> Found:
        rows = [sent for name in PUSHES for sent in by_node(log, name).values()]
        return [one.numbers for sent in rows for before, one in pairwise(sent) if wrong(before, one)]

    return find


def _sequence_of(one: Message) -> int:
    return one["data_sequence"]


def restarted(before: Message, one: Message) -> bool:
    """TYP-503: lower than before, and not because 32 bits are full."""
    return _sequence_of(one) < _sequence_of(before) and not (
        _sequence_of(before) > 0xFFFF_0000 and _sequence_of(one) < 0x1_0000
    )


FINDERS: dict[str, Finder] = {
    "TYP-401": reserved,
    "TYP-402": backwards,
    "TYP-403": identity,
    "TYP-404": date_format,
    "TYP-501": _sequence(lambda before, one: _sequence_of(one) - _sequence_of(before) > 1),
    "TYP-502": _sequence(
        lambda before, one: _sequence_of(one) == _sequence_of(before) and one.payload != before.payload
    ),
    "TYP-503": _sequence(restarted),
    "TYP-504": lambda log: where(log, PUSHES, lambda one: not one["data"]),
}
