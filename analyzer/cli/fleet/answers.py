"""`tailbyte fleet report`, `status` and `compact`: what a store says."""

from __future__ import annotations

import json
import shutil
import sys
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.pager import paged
from analyzer.fleet.store import ResultStore
from analyzer.views.terminal import escape
from dissectors.times import SECOND

if TYPE_CHECKING:
    import argparse

NAME = "tailbyte fleet"
_SHOWN, _WIDTH = 10, 80


def tell_status(args: argparse.Namespace) -> int:
    """Say how far the runs have come; return the exit status."""
    answers = ResultStore(args.place[0]).connected()
    ask = answers.execute
    lines = ["run                 ended        listed  skipped     done  unavailable   CPU s"]
    for start, ended, *counts, cpu in ask(
        "select start_ns, ended, listed, skipped, done, unavailable, cpu_s from runs order by start_ns desc limit 10"
    ).fetchall():
        began = datetime.fromtimestamp(start / SECOND, UTC)
        lines.append(
            f"{began:%Y-%m-%d %H:%M:%S} {ended:<11} {counts[0]:>7} {counts[1]:>8} {counts[2]:>8} {counts[3]:>12} "
            f"{cpu:>7.1f}"
        )
    lines.append("")
    for outcome, count in ask(
        "select outcome, count(*) from latest group by outcome order by 2 desc, 1"
    ).fetchall():  # fmt: skip
        lines.append(f"{count:>9,} {outcome}")
    bad = ask("select url, error from latest where error <> '' order by url").fetchall()
    lines += [f"  {escape(url)}: {escape(error)}" for url, error in bad[:_SHOWN]]
    if len(bad) > _SHOWN:
        lines.append(f"  and {len(bad) - _SHOWN} more: fleet report --json -")
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    return status.OK


def compact(args: argparse.Namespace) -> int:
    """Put small files together; return the exit status."""
    store = ResultStore(args.place[0])
    with store.alone():
        left = store.compact()
    for name, count in left.items():
        sys.stdout.write(f"{name}: {count} file{'' if count == 1 else 's'}\n")
    return status.OK if left else status.NOT_JUDGED


def report(args: argparse.Namespace) -> int:
    """Say what is wrong with the fleet; return the exit status."""
    from analyzer.fleet.report import page, text  # noqa: PLC0415
    from analyzer.fleet.report.build import build  # noqa: PLC0415
    from analyzer.sinks.atomic import Target, TargetError  # noqa: PLC0415

    found = build(ResultStore(args.place[0]), args.since, args.flights)
    try:
        if args.html:
            with Target(args.html) as out:
                out.file.write(page.render(found).encode("utf-8", "backslashreplace"))
        if args.json:
            with Target(args.json) as out:
                out.file.write(f"{json.dumps(found.as_json(), indent=1)}\n".encode())
    except TargetError as error:
        return status.damaged(error, NAME)
    if "-" not in (args.html, args.json):
        with paged(wanted=not args.no_pager) as shown:
            width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _WIDTH
            shown.write(text.render(found, width=width, by=args.by))
    return status.OK
