"""`tailbyte check --extract DIR`: of each finding the smallest capture that still shows it."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.app.targets import refuse_filled, refuse_input

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer._native import FrameBatch
    from analyzer.app.criteria import Criteria
    from analyzer.app.request import Request
    from analyzer.report.model import Finding, Report
    from analyzer.rules.extract.search import Extract, WantedFinding
    from dissectors import Registry

MOST_FILES = 100
_LONGEST = 100  # characters of a name, without what comes after it


def refuse(folder: str | None, names: Iterable[str], *, force: bool) -> None:
    """Raise `ValueError` if the parts are to come from what can be read only once, or have no place.

    Among other files they have one only with `force`.
    """
    if folder is None:
        return
    if not folder:
        raise ValueError("--extract: the folder has no name")
    for name in names:
        if name == "-" or Path(name).is_fifo() or Path(name).is_char_device():
            shown = "standard input" if name == "-" else name
            raise ValueError(f"--extract reads the capture again, {shown} exists only once: save it to a file first")
    if Path(folder).exists() and not Path(folder).is_dir():
        raise ValueError(f"--extract {folder}: is not a folder")
    refuse_filled(folder, force=force)


def recorded(request: Request, registry: Registry) -> Iterator[FrameBatch]:
    """Yield the rows that were judged, from the first; nothing is counted or complained of a second time."""
    from analyzer.app.run import Run  # noqa: PLC0415
    from analyzer.window.limits import Window  # noqa: PLC0415

    if request.window.frames is not None:  # of those the findings have the numbers in the file
        request = replace(request, window=Window())
    return Run(request, registry=registry).frame_batches_inside()


def extract(report: Report, request: Request, criteria: Criteria, folder: str) -> bool:
    """Write the parts of what was requested and judged, and say on standard error what was written.

    Returns whether each finding that is to have a file has one; one that cannot be written does not stop the others.

    Every file is there whole or not at all; what the folder already has stays, but for files of the same name.
    """
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    found = list(report.findings)
    names = list(_names(found[:MOST_FILES]))
    count, lines = 0, 0
    try:
        _make(folder)
    except TargetError as error:
        streams.complain(str(error))
        return False
    for capture, part_of in request.each().items():
        here = [(one, name) for one, name in zip(found, names, strict=False) if one.capture == capture]
        wanted = {id(part): (name, part) for name, part in ((name, _wanted(one)) for one, name in here)}
        parts = [part for _, part in wanted.values()]
        for made in _extracts(parts, part_of, criteria):
            name = wanted[id(made.wanted)][0]
            if not made.shown:
                streams.complain(f"{name}: no part of {capture} shows the finding, nothing is written")
                continue
            try:
                _write(str(Path(folder, name)), made.text, request)
            except (TargetError, ValueError) as error:
                streams.complain(str(error))
                continue
            count, lines = count + 1, lines + made.lines
    missing = len(names) - count
    more = f"; {missing} could not be written" if missing else ""
    more += f"; {len(found) - MOST_FILES} more findings have none" if len(found) > MOST_FILES else ""
    streams.tell(f"-- {count} of {len(found)} findings written to {folder}, {lines} lines{more}\n")
    return not missing


def _extracts(parts: Sequence[WantedFinding], request: Request, criteria: Criteria) -> Iterator[Extract]:
    from analyzer.rules.extract.search import extracts  # noqa: PLC0415

    registry = criteria.registry
    return extracts(parts, lambda: recorded(request, registry), registry, criteria.settings)


def _make(folder: str) -> None:
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TargetError(folder, error) from None


def _write(path: str, text: bytes, request: Request) -> None:
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    refuse_input(request.names, path)
    with Target(path) as target:
        target.file.write(text)


def _names(findings: Sequence[Finding]) -> Iterator[str]:
    """`RULE-nodeN-TYPE-K.log`, safe on any file system: types of a capture may have any name."""
    counts: Counter[str] = Counter()
    for one in findings:
        node = None if one.node is None else f"node{one.node}"
        words = (re.sub(r"[^A-Za-z0-9_.-]+", "_", word) for word in (one.rule, node, one.type) if word)
        stem = "-".join(words)[:_LONGEST]
        counts[stem.lower()] += 1  # some file systems do not tell cases apart
        yield f"{stem}-{counts[stem.lower()]}.log"


def _wanted(one: Finding) -> WantedFinding:
    from analyzer.rules.extract.search import WantedFinding  # noqa: PLC0415
    from analyzer.rules.verdicts import COARSE  # noqa: PLC0415
    from dissectors.kit import NO_TIME  # noqa: PLC0415

    t = NO_TIME if one.first.t_ns is None else one.first.t_ns
    frames = one.frames if one.first.frame is None else (one.first.frame,)
    severity = "" if one.cause.startswith(COARSE) else one.severity  # which only the report makes a note
    return WantedFinding(one.rule, severity, one.bus, one.node, one.type, frames, t, t)
