"""`tailbyte check --init`: a vehicle file from a healthy capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, INTERRUPTED, OK, streams

if TYPE_CHECKING:
    import argparse

    from analyzer.report.build import Taken
    from analyzer.report.model import Report
    from dissectors import Registry

NOT_JUDGED = 4
_CLASHING = ("profile", "baseline", "junit", "html", "json", "markdown", "github", "extract")


def target(args: argparse.Namespace) -> str:
    """Where the file goes, `-` by default. Raises `ValueError` for options that do not go with --init."""
    if clash := next((name for name in _CLASHING if getattr(args, name)), None):
        raise ValueError(f"--init writes a vehicle file and no report: not with --{clash}")
    if len(args.output) > 1:
        raise ValueError("--init writes one file")
    return args.output[0] if args.output else "-"


def write(path: str, report: Report, taken: Taken, registry: Registry, *, interrupted: bool) -> int:
    """Writes the file, with a warning if the capture is no good model; the exit status. Raises `TargetError`."""
    from analyzer.report.initial import vehicle_file  # noqa: PLC0415
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    capture = report.captures[0]
    if not capture.nodes:
        if not taken.damage:
            streams.complain(f"{capture.path}: no node speaks DroneCAN: no vehicle file")
        return DAMAGED if taken.damage else NOT_JUDGED
    errors = [one for one in report.findings if (one.category, one.severity) == ("protocol", "error")]
    if errors:
        rules = ", ".join(dict.fromkeys(one.rule for one in errors))
        streams.complain(f"{capture.path}: warning: no healthy capture, protocol errors: {rules}")
    text = vehicle_file(taken, capture, registry, report.settings["bit_rate"])
    with Target(path) as out:
        out.file.write(text.encode("utf-8", "backslashreplace"))
    return INTERRUPTED if interrupted else DAMAGED if taken.damage else OK
