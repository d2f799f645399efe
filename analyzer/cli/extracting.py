"""`tailbyte check --extract DIR`: of each finding the smallest capture that still shows it."""

from __future__ import annotations

import argparse
import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import options, streams

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer._native import Piece
    from analyzer.report.model import Finding, Report
    from analyzer.rules.extract import Wanted
    from analyzer.rules.settings import Settings
    from analyzer.window import Window
    from dissectors import Registry

MOST_FILES = 100
_LONGEST = 100  # characters of a name, without what comes after it


@dataclass(frozen=True, slots=True)
class Origin:
    """Where findings come from: `groups` are the files of each capture by its name in the report."""

    args: argparse.Namespace
    groups: Mapping[str, list[str]]
    registry: Registry
    settings: Settings
    window: Window | None = None

    def pieces(self, capture: str) -> Iterator[Piece]:
        """The rows that were judged, from the first; nothing is counted or complained about a second time."""
        from analyzer.cut import FrameSelection  # noqa: PLC0415
        from analyzer.sources.merge import open_captures  # noqa: PLC0415
        from analyzer.sources.native import rows  # noqa: PLC0415

        args = argparse.Namespace(**{**vars(self.args), "capture": self.groups[capture], "capture_": []})
        source = open_captures(options.captures(args), options.plan(args))
        pieces = (piece for piece in rows(source.chunks()) if not isinstance(piece, bytes))
        if not self.window or self.window.frames is not None:  # of those the findings have the numbers in the file
            return pieces
        return FrameSelection(self.window, lambda: self._again(capture)).cut(pieces)

    def _again(self, capture: str) -> Iterator[Piece]:
        return replace(self, window=None).pieces(capture)


def refuse_streams(args: argparse.Namespace, names: Sequence[str]) -> None:
    """Raises `ValueError` if the parts are to come from what can be read only once, or have no place."""
    if args.extract is None:
        return
    if not args.extract:
        raise ValueError("--extract: the folder has no name")
    for name in names:
        if name == "-" or Path(name).is_fifo() or Path(name).is_char_device():
            shown = "standard input" if name == "-" else name
            raise ValueError(f"--extract reads the capture again, {shown} exists only once: save it to a file first")
    if Path(args.extract).exists() and not Path(args.extract).is_dir():
        raise ValueError(f"--extract {args.extract}: is not a folder")


def extract(report: Report, origin: Origin, folder: str) -> bool:
    """Writes the parts and says on standard error what was written; whether all of it could be.

    Every file is there whole or not at all; what the folder already has stays, but for files of the same name.
    """
    from analyzer.rules.extract import extracts  # noqa: PLC0415
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    found = list(report.findings)
    names = list(_names(found[:MOST_FILES]))
    count, frames = 0, 0
    try:
        _make(folder)
        for capture in origin.groups:
            here = [(one, name) for one, name in zip(found, names, strict=False) if one.capture == capture]
            wanted = {id(part): (name, part) for name, part in ((name, _wanted(one)) for one, name in here)}
            parts = [part for _, part in wanted.values()]
            for made in extracts(parts, lambda: origin.pieces(capture), origin.registry, origin.settings):  # noqa: B023 - used at once
                name = wanted[id(made.wanted)][0]
                if not made.shown:
                    streams.complain(f"{name}: no part of {capture} shows the finding, nothing is written")
                    continue
                _write(str(Path(folder, name)), made.text, origin.args)
                count, frames = count + 1, frames + made.frames
    except (TargetError, ValueError) as error:
        streams.complain(str(error))
        return False
    more = f"; {len(found) - MOST_FILES} more findings have none" if len(found) > MOST_FILES else ""
    streams.tell(f"-- {count} of {len(found)} findings written to {folder}, {frames} frames{more}\n")
    return True


def _make(folder: str) -> None:
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TargetError(folder, error) from None


def _write(path: str, text: bytes, args: argparse.Namespace) -> None:
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    options.refuse_input(args, path)
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


def _wanted(one: Finding) -> Wanted:
    from analyzer.rules.extract import Wanted  # noqa: PLC0415
    from analyzer.rules.verdicts import COARSE  # noqa: PLC0415
    from dissectors.conformance import NO_TIME  # noqa: PLC0415

    t = NO_TIME if one.first.t_ns is None else one.first.t_ns
    frames = one.frames if one.first.frame is None else (one.first.frame,)
    severity = "" if one.cause.startswith(COARSE) else one.severity  # which only the report makes a note
    return Wanted(one.rule, severity, one.bus, one.node, one.type, frames, t, t)
