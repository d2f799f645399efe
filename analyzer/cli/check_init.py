"""`tailbyte check --init`: a vehicle file from a healthy capture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.cli import status

if TYPE_CHECKING:
    import argparse

    from analyzer.facts.periods import Periods
    from analyzer.report.draft import JudgedCapture
    from analyzer.report.model import Report
    from dissectors import Registry

_CLASHING = ("vehicle", "baseline", "junit", "html", "json", "markdown", "github", "extract")


def target(args: argparse.Namespace) -> str:
    """Return where the file goes, `-` by default. Raises `ValueError` for options that do not go with --init."""
    if clash := next((name for name in _CLASHING if getattr(args, name)), None):
        raise ValueError(f"--init writes a vehicle file and no report: not with --{clash}")
    if len(args.output) > 1:
        raise ValueError("--init writes one file")
    path: str = args.output[0] if args.output else "-"
    if path != "-" and not args.force and Path(path).is_file():
        raise ValueError(f"{path}: exists, and somebody may have completed it; --force writes over it")
    return path


@dataclass(frozen=True, slots=True)
class Model:
    """The capture that the file is made from, and what it was read with."""

    report: Report
    taken: JudgedCapture
    registry: Registry
    periods: Periods


def write(path: str, model: Model, *, force: bool, interrupted: bool) -> int:
    """Write the file unless the capture is no good model; return the exit status. Raises `TargetError`."""
    from analyzer.report.vehicle.initial import vehicle_file  # noqa: PLC0415
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    report, taken = model.report, model.taken
    capture = report.captures[0]
    if not capture.nodes:
        if not taken.damage:
            streams.complain(f"{capture.path}: no node speaks DroneCAN: no vehicle file")
        return status.DAMAGED if taken.damage else status.NOT_JUDGED
    sick = (one for one in report.findings if one.fails or (one.category, one.severity) == ("device", "error"))
    rules = ", ".join(dict.fromkeys(one.rule for one in sick))
    warning = f"no healthy capture, findings of {rules}" if rules else ""
    if warning:
        advice = "written all the same" if force else "no vehicle file (--force writes one all the same)"
        streams.complain(f"{capture.path}: {warning}: {advice}")
        if not force:
            return status.FINDINGS
    text = vehicle_file(taken, capture, model.registry, report.settings["bit_rate"], model.periods.all, warning)
    with Target(path) as out:
        out.file.write(text.encode("utf-8", "backslashreplace"))
    return status.INTERRUPTED if interrupted else status.DAMAGED if taken.damage else status.OK
