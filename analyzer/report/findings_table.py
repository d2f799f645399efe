"""The findings of a report as a table, whose rows point to frames and transfers as those of other tables do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.tables import FINDINGS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.report.model import Finding


def frames_of(findings: Iterable[Finding]) -> set[int]:
    """Return the numbers of all frames that are named, from 0."""
    named = (place for one in findings for place in (one.first.frame, *one.frames))
    return {frame - 1 for frame in named if frame is not None}


def table(findings: Iterable[Finding], buses: Sequence[str], transfers: Mapping[int, int]) -> pa.RecordBatch:
    """Return a row for each finding.

    Args:
        findings: in their order.
        buses: names of interfaces by index.
        transfers: the transfer of each frame that is in one, numbers from 0.
    """
    index = {name: k for k, name in enumerate(buses)}
    rows = [_row(number, one, index, transfers) for number, one in enumerate(findings, 1)]
    return pa.RecordBatch.from_pylist(rows, schema=FINDINGS)


def _row(number: int, one: Finding, buses: Mapping[str, int], transfers: Mapping[int, int]) -> dict[str, Any]:
    frame, last = one.first.frame, one.last.frame
    frames = [named - 1 for named in one.frames]
    return {
        "finding": number,
        "rule": one.rule,
        "title": one.title,
        "severity": one.severity,
        "category": one.category,
        "origin": one.origin,
        "clause": one.clause or None,
        "t": one.first.t_ns,
        "t_end": one.last.t_ns,
        "bus": buses.get(one.bus),
        "node": one.node,
        "label": one.label or None,
        "type": one.type or None,
        "key": one.key or None,
        "cause": one.cause or None,
        "text": one.text,
        "count": one.count,
        "frame": None if frame is None else frame - 1,
        "frame_end": None if last is None else last - 1,
        "transfer": None if frame is None else transfers.get(frame - 1),
        "frames": frames,
        "transfers": list(dict.fromkeys(transfers[at] for at in frames if at in transfers)),
        "waived": one.waiver is not None,
    }
