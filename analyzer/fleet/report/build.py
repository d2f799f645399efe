"""The report of a store."""

from __future__ import annotations

import re
from datetime import date, timedelta
from shlex import quote
from typing import TYPE_CHECKING, Any

from analyzer.fleet.report.model import FleetHead, FleetReport, OpenFirst, RuleCount, Unread, VehicleCount
from analyzer.fleet.report.odd import odd_escs
from analyzer.fleet.report.rates import by_software, since_then
from analyzer.fleet.tables import UNAVAILABLE

if TYPE_CHECKING:
    import duckdb

    from analyzer.fleet.store import ResultStore

_SUPPORTS = "case t.support when 'well supported' then 0 when 'likely' then 1 else 2 end"


def build(store: ResultStore, since: str | None, least: int) -> FleetReport:
    """Return it; `since` is a day, or a time back from the newest capture (7d).

    Raises `StoreError`, and `ValueError` for what is no time.
    """
    answers = store.connected()
    head = _head(answers, store.place)
    odd, tested = odd_escs(answers, least)
    software, rates = by_software(answers)
    day = "" if since is None else _day(since, head.last_day)
    return FleetReport(
        head=head,
        open_first=tuple(_open_first(answers)),
        odd=tuple(odd),
        tested=tested,
        least_flights=least,
        software=tuple(software),
        rates=tuple(rates),
        since=since_then(answers, day) if day else None,
        rules=tuple(RuleCount(*row) for row in _rows(answers, _RULES)),
        vehicles=tuple(VehicleCount(*row) for row in _rows(answers, _VEHICLES)),
        unread=tuple(Unread(*row) for row in _rows(answers, _UNREAD)),
    )


def _rows(answers: duckdb.DuckDBPyConnection, question: str) -> list[tuple[Any, ...]]:
    return answers.execute(question).fetchall()


_HEAD = f"""
select count(*), count(*) filter (not duplicate and verdict in ('pass', 'fail')),
    count(*) filter (not duplicate and verdict = 'not judged'),
    count(*) filter (not duplicate and outcome = 'damaged'),
    count(*) filter (error <> '' and outcome <> '{UNAVAILABLE}'),
    count(*) filter (outcome = '{UNAVAILABLE}'), count(*) filter (duplicate),
    count(distinct vehicle) filter (vehicle <> '' and not duplicate),
    coalesce(sum(flights) filter (not duplicate), 0)::bigint,
    coalesce(sum(flight_ns) filter (not duplicate), 0) / 3.6e12,
    coalesce(min(date) filter (date <> ''), ''), coalesce(max(date) filter (date <> ''), '') from latest
"""  # noqa: S608 - our own word
_RULES = """
with broken as (select f.rule, min(f.title) as title, min(f.severity) as severity, c.key, c.vehicle, c.url
        from findings f join counted c using (key, run) where f.severity <> 'note' and f.category <> 'capture'
        and not f.waived group by f.rule, c.key, c.vehicle, c.url),
    each as (select rule, vehicle, count(*) as captures from broken where vehicle <> '' group by 1, 2)
select rule, min(title), min(severity), count(*), count(distinct vehicle) filter (vehicle <> ''), min(url),
    coalesce((select arg_max(e.vehicle, (e.captures, e.vehicle)) from each e where e.rule = b.rule), ''),
    coalesce((select max(e.captures) from each e where e.rule = b.rule), 0) from broken b group by 1 order by 4 desc, 1
"""
_VEHICLES = """
select vehicle, count(*), count(*) filter (verdict = 'fail'), sum(flights)::bigint, sum(flight_ns) / 3.6e12
    from counted group by 1 order by 3 desc, 2 desc, 1
"""
_UNREAD = "select url, outcome, error from latest where error <> '' order by url"
_OPEN = f"""
select c.vehicle, c.date, t.title, t.kind, t.support, t.ch, c.url from triage t join counted c using (key, run)
    where t.place = 1 and t.support <> '' order by {_SUPPORTS}, c.date desc, c.url
"""  # noqa: S608 - our own words


def _head(answers: duckdb.DuckDBPyConnection, place: str) -> FleetHead:
    (row,) = _rows(answers, _HEAD)
    settings, versions = (
        tuple(one for (one,) in _rows(answers, f"select distinct {name} from latest order by 1"))  # noqa: S608
        for name in ("settings", "version")
    )
    return FleetHead(*(place, *row, settings, versions))


def _open_first(answers: duckdb.DuckDBPyConnection) -> list[OpenFirst]:
    return [OpenFirst(*(*row, f"tailbyte {quote(row[-1])}")) for row in _rows(answers, _OPEN)]


def _day(since: str, last: str) -> str:
    if back := re.fullmatch(r"(\d{1,4})([dw])", since):
        if not last:
            return ""
        days = int(back[1]) * (7 if back[2] == "w" else 1)
        return (date.fromisoformat(last) - timedelta(days - 1)).isoformat()
    try:
        return date.fromisoformat(since).isoformat()
    except ValueError:
        raise ValueError(f"--since {since}: it takes a day (2026-11-15), or days back from the newest (7d)") from None
