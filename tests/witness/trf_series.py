"""Proofs of TRF-016 to TRF-025, TRF-028 and TRF-031: what follows from one transfer to the next."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise
from typing import TYPE_CHECKING

from witness import can
from witness.reader import SECOND, TIMEOUT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from witness.reader import Log, Transfer
    from witness.views import Found

ANSWER_TIME, SLOW = SECOND, SECOND // 2
# How many transfers in a row, of how many each type, show a shared counter.
RUN, EACH = 20, 3
# Copies of a transfer on two interfaces are not further apart, in ns.
APART = 50_000_000


def pairs(log: Log) -> Iterator[tuple[Transfer, Transfer]]:
    """Each transfer behind the one before of its session, within two seconds; anonymous nodes have no session."""
    ours = can.trusted(log)
    for key, transfers in log.by_session.items():
        if key in ours and key[1] != "anonymous":
            yield from ((before, one) for before, one in pairwise(transfers) if one.t - before.t <= TIMEOUT)


def step(before: Transfer, one: Transfer) -> int:
    return (one.first.tid - before.first.tid) % 32


def restarted(before: Transfer, one: Transfer) -> bool:
    return one.first.tid == 0 and step(before, one) > 1


def find_trf_016(log: Log) -> Found:
    return [
        before.numbers | one.numbers
        for before, one in pairs(log)
        if step(before, one) > 1 and not restarted(before, one)
    ]


def find_trf_017(log: Log) -> Found:
    return [
        before.numbers | one.numbers
        for before, one in pairs(log)
        if step(before, one) == 0 and before.whole and one.whole and before.joined == one.joined
    ]


def find_trf_018(log: Log) -> Found:
    return [
        before.numbers | one.numbers
        for before, one in pairs(log)
        if step(before, one) == 0 and before.whole and one.whole and before.joined != one.joined
    ]


def find_trf_019(log: Log) -> Found:
    return [before.numbers | one.numbers for before, one in pairs(log) if restarted(before, one)]


def find_trf_020(log: Log) -> Found:
    """Runs of one node's messages whose transfer IDs rise by one over all types, while those of every type jump."""
    sent: dict[object, list[Transfer]] = defaultdict(list)
    for one in log.transfers:
        if one.first.kind == "message" and one.first.session in can.trusted(log):
            sent[one.first.bus, one.first.src].append(one)
    return [
        set().union(*(one.numbers for one in run))
        for transfers in sent.values()
        for run in _runs(transfers)
        if _shared(run)
    ]


def _runs(transfers: list[Transfer]) -> Iterator[list[Transfer]]:
    run = transfers[:1]
    for before, one in pairwise(transfers):
        if step(before, one) != 1:
            yield run
            run = []
        run.append(one)
    yield run


def _shared(run: list[Transfer]) -> bool:
    types: dict[int, list[Transfer]] = defaultdict(list)
    for one in run:
        types[one.first.type_id].append(one)
    often = [transfers for transfers in types.values() if len(transfers) >= EACH]
    jump = all(any(step(before, one) > 1 for before, one in pairwise(transfers)) for transfers in often)
    return len(run) >= RUN and len(often) > 1 and jump


def calls(log: Log) -> Iterator[tuple[Transfer | None, list[Transfer]]]:
    """Each request with its responses within two seconds; responses to nothing come with None."""
    ours = can.trusted(log)
    open_calls: dict[object, tuple[Transfer, list[Transfer]]] = {}
    for one in log.transfers:
        first = one.first
        if first.session not in ours or not one.whole:
            continue
        if first.kind == "request":
            key = first.bus, first.type_id, first.src, first.dst, first.tid
            if key in open_calls:
                yield open_calls[key]
            open_calls[key] = one, []
        elif first.kind == "response":
            key = first.bus, first.type_id, first.dst, first.src, first.tid
            call = open_calls.get(key)
            if call is None or one.t - call[0].t > TIMEOUT:
                yield None, [one]
            else:
                call[1].append(one)
    yield from open_calls.values()


def _delay(request: Transfer, response: Transfer) -> int:
    return response.frames[-1].t - request.frames[-1].t


def find_trf_021(log: Log) -> Found:
    return [responses[0].numbers for request, responses in calls(log) if request is None]


def find_trf_022(log: Log) -> Found:
    end = log.frames[-1].t
    return [
        request.numbers
        for request, responses in calls(log)
        if request is not None
        and end - request.frames[-1].t > ANSWER_TIME
        and not any(_delay(request, one) <= ANSWER_TIME for one in responses)
    ]


def find_trf_023(log: Log) -> Found:
    return [
        request.numbers | responses[0].numbers
        for request, responses in calls(log)
        if request is not None and responses and _delay(request, responses[0]) > SLOW
    ]


def find_trf_024(log: Log) -> Found:
    return [
        set().union(*(one.numbers for one in responses))
        for request, responses in calls(log)
        if request is not None and len(responses) > 1
    ]


def find_trf_025(log: Log) -> Found:
    return [
        request.numbers | one.numbers
        for request, responses in calls(log)
        if request is not None
        for one in responses
        if one.first.priority != request.first.priority
    ]


def find_trf_028(log: Log) -> Found:
    """A transfer of a session that two interfaces show, while both do, that only one of them has, or has like this."""
    views: dict[object, dict[str, list[Transfer]]] = defaultdict(dict)
    for key, transfers in log.by_session.items():
        views[key[1:]][key[0]] = [one for one in transfers if one.whole]
    both = [tuple(seen.values()) for seen in views.values() if len(seen) == 2 and all(seen.values())]
    return [
        one.numbers
        for first, second in both
        for mine, other in ((first, second), (second, first))
        for one in mine
        if other[0].t <= one.t <= other[-1].t
        and not any(abs(one.t - copy.t) <= APART and _same(one, copy) for copy in other)
    ]


def _same(one: Transfer, copy: Transfer) -> bool:
    return one.first.tid == copy.first.tid and one.joined == copy.joined


def find_trf_031(log: Log) -> Found:
    """Types without a signature whose CRCs all begin with one value; the others of such a type are outliers."""
    found = []
    for transfers in can.unknown(log).values():
        checked = [one for one in transfers if one.many and one.whole]
        common = Counter(can.starts(checked)).most_common(1)
        if common and common[0][1] > 1:
            found.append(set().union(*(one.numbers for one in checked)))
    return found
