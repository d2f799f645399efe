"""Proofs of TYP-014 and TYP-201 to TYP-504: values of fields, what is remembered, and numbers that count up."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING

from witness.views import SECOND, Finder, Found, Latest, Message, by_node, everything, messages, prefixed, where

if TYPE_CHECKING:
    from collections.abc import Callable

    from witness.reader import Log

PARAMETERS = ("ParamCfg", "ParamGet")
WIDE = ("esc_id_set", "esc_ov_threshold", "esc_oc_threshold", "esc_ot_threshold", "esc_acc_threshold")
WIDE += ("esc_dacc_threshold", "esc_rotate_dir", "esc_led_mode", "esc_fdb_rate")
COUNTERS = ("esc_startup_times", "esc_startup_duration", "esc_error_count")
PUSHES = ("PUSHSCI", "PUSHCAN")


def query(one: Message) -> bool:
    """Is it a ParamCfg that asks for the parameters: 27 bytes of 0xFF?"""
    return one.name == "ParamCfg" and one.payload[:27] == b"\xff" * 27


def _parameter(field: str, allowed: Callable[[int], bool], names: tuple[str, ...] = PARAMETERS) -> Finder:
    return lambda log: where(log, names, lambda one: not allowed(one[field]))


def index(log: Log) -> Found:
    """TYP-201: an index above 19, but 0xFF for all of them in ParamCfg."""
    names = (*PARAMETERS, "ESCStatus")
    return where(log, names, lambda one: one["esc_index"] > 19 and (one.name, one["esc_index"]) != ("ParamCfg", 0xFF))


def identifier(log: Log) -> Found:
    """TYP-202: an ID above 19 that is not "all"; one that a ParamGet repeats as its index is TYP-201."""

    def wrong(one: Message) -> bool:
        value = one["esc_id_set" if one.name == "ParamCfg" else "esc_id_req"]
        repeated = one.name == "ParamGet" and value == one["esc_index"]
        return value > 19 and value not in {0xFF, 0xFFFF} and not repeated

    return where(log, PARAMETERS, wrong)


def save_option(log: Log) -> Found:
    """TYP-207: neither 0 nor 1, but 0xFF in a query."""
    return where(log, PARAMETERS, lambda one: one["esc_save_option"] > 1 and not query(one))


def queried(log: Log) -> Found:
    """TYP-208: a ParamCfg of 27 bytes 0xFF."""
    return where(log, ("ParamCfg",), query)


def ambiguous(log: Log) -> Found:
    """TYP-209: 0x00FF in 16 bits, or some bytes of 32 bits but not all are 0xFF."""

    def wrong(one: Message) -> bool:
        ones = one["esc_uuid"].to_bytes(4, "little").count(0xFF)
        return 0 < ones < 4 or any(one[name] == 0xFF for name in WIDE)

    return where(log, ("ParamCfg",), wrong)


def written_in_flight(log: Log) -> Found:
    """TYP-210: parameters are to be kept, within the second behind a speed of 100 rpm of the ESC with that index."""
    reports: dict[int, list[Message]] = {}
    for one in messages(log, "ESCStatus"):
        reports.setdefault(one["esc_index"], []).append(one)
    return where(log, ("ParamCfg",), lambda one: one["esc_save_option"] == 1 and _turned(one, reports))


def _turned(one: Message, reports: dict[int, list[Message]]) -> bool:
    before = Latest(reports.get(one["esc_index"], [])).between(one.t - SECOND, one.t)
    return bool(before) and abs(before[-1]["rpm"]) >= 100


def _finite(one: Message) -> bool:
    return math.isfinite(one["temperature"])


def kelvin(log: Log) -> Found:
    """TYP-301: all finite temperatures of a node are in 200..500, which is not the document's degrees Celsius.

    Nodes whose temperatures are all in -60..200 are as the document says; the rule's note on them is no oddity.
    """
    found = []
    for sent in by_node(log, "ESCStatus").values():
        warm = [one for one in sent if _finite(one)]
        if warm and all(200 <= one["temperature"] <= 500 for one in warm):
            found.append(set().union(*(one.numbers for one in warm)))
    return found


def mode(one: Message) -> int:
    """The operating mode of an ESCStatus."""
    return one["error_count"] >> 12 & 15


def _status(log: Log) -> dict[int, list[Message]]:
    """ESCStatus by node, of nodes whose first word is status bits.

    Those have shown a mode that is defined, or send PUSHCAN or ParamGet; others count errors.
    """
    vendor = {one.src for one in everything(log) if one.name in {"PUSHCAN", "ParamGet"}}
    vendor |= {one.src for one in messages(log, "ESCStatus") if 1 <= mode(one) <= 8}
    return {src: sent for src, sent in by_node(log, "ESCStatus").items() if src in vendor}


def _bits(wrong: Callable[[Message], bool]) -> Finder:
    return lambda log: [one.numbers for sent in _status(log).values() for one in sent if wrong(one)]


def counter(log: Log) -> Found:
    """TYP-307: a node never shows a mode of 1..8, and its first word never falls and rises by small steps only."""
    found = []
    for sent in by_node(log, "ESCStatus").values():
        pairs = list(pairwise(sent))
        steps = [one["error_count"] - before["error_count"] for before, one in pairs]
        rises = [one for (_, one), step in zip(pairs, steps, strict=True) if step]
        modes = any(1 <= mode(one) <= 8 for one in sent)
        if not modes and len(rises) >= 2 and all(0 <= step <= 16 for step in steps):
            found.append(set().union(*(one.numbers for one in rises)))
    return found


def implausible(log: Log) -> Found:
    """TYP-308: voltage, current, temperature or speed that no ESC has."""

    def wrong(one: Message) -> bool:
        voltage, current, temperature = one["voltage"], one["current"], one["temperature"]
        outside = temperature < -60 or temperature > 500
        return voltage < 0 or voltage > 120 or abs(current) > 1000 or outside or abs(one["rpm"]) > 100_000

    return where(log, ("ESCStatus",), wrong)


def nameless(log: Log) -> Found:
    """TYP-014: a mode of a node that DroneCAN does not name, in NodeStatus or in its copy."""

    def wrong(one: Message) -> bool:
        return one.values.get("status", one.values)["mode"] in {4, 5, 6}

    return where(log, ("uavcan.protocol.NodeStatus", "uavcan.protocol.GetNodeInfo.Response"), wrong)


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
    "TYP-014": nameless,
    "TYP-201": index,
    "TYP-202": identifier,
    "TYP-203": _parameter("esc_timing", lambda value: 1 <= value <= 29 or value == 0xFF),
    "TYP-204": _parameter("esc_signal_priority", lambda value: value in {0, 1, 0xFF}),
    "TYP-205": _parameter("esc_can_rate", lambda value: value <= 5 or value == 0xFF),
    "TYP-206": _parameter("esc_fdb_rate", lambda value: value <= 400 or value == 0xFFFF),
    "TYP-207": save_option,
    "TYP-208": queried,
    "TYP-209": ambiguous,
    "TYP-210": written_in_flight,
    "TYP-301": kelvin,
    "TYP-302": lambda log: where(log, ("ESCStatus",), lambda one: one["power_rating_pct"] > 100),
    "TYP-303": _bits(lambda one: one["error_count"] >> 16 > 16383),
    "TYP-304": _bits(lambda one: not 1 <= mode(one) <= 8),
    "TYP-305": _bits(lambda one: bool(one["error_count"] & 0xFFF)),
    "TYP-306": _bits(lambda one: mode(one) == 6),
    "TYP-307": counter,
    "TYP-308": implausible,
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
