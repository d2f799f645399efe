"""`tailbyte fleet`: thousands of captures: judge them, export tables, ask what is wrong with the fleet."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options, rules

if TYPE_CHECKING:
    from collections.abc import Callable

NAME = "tailbyte fleet"
_NEEDED = ("distributed", "fsspec", "deltalake", "duckdb")
# Options that only some actions take.
_READS, _CHECK, _EXPORT, _REPORT = ("check", "export"), ("check",), ("export",), ("report",)
_OF = {
    **dict.fromkeys(("name", "names", "scheduler", "workers", "memory", "attempts", "dissector", "trusted"), _READS),
    **dict.fromkeys(("select", "ignore", "origin", "vehicle", "dialect", "fail_on", "least", "baseline"), _CHECK),
    **dict.fromkeys(("retry", "bitrate"), _CHECK),
    **dict.fromkeys(("table", "partition"), _EXPORT),
    **dict.fromkeys(("since", "by", "flights", "html", "json"), _REPORT),
}
_EPILOG = """\
check    judge captures, and keep the results in the store -o: what is done is not done again
export   decoded tables of captures, as Parquet below -o
report   what fails and why, odd ESCs, firmware, what got worse, which captures to open
status   how far the runs into a store have come
compact  put the small files of a store together

A capture is named by a path, a pattern ('logs/**/*.log.gz'), a folder or an address (s3://...). Keys for a storage come
from its environment variables, never from here.

exit status: 0 done, whatever it found, 2 wrong usage, 3 captures without a result or a store that cannot be read or
written, 4 no capture is named, 130 interrupted: the next run goes on."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s check|export CAPTURES... -o STORE [options]\n       %(prog)s report|status|compact STORE"
    parser.description = __doc__
    parser.epilog = _EPILOG
    parser.add_argument("action", metavar="ACTION", choices=tuple(_ACTIONS), help=", ".join(_ACTIONS))
    parser.add_argument("place", nargs="*", metavar="CAPTURES", help="patterns, folders or addresses; or the STORE")
    parser.add_argument("-o", "-w", dest="output", metavar="STORE", help="folder or address of the results")
    group = parser.add_argument_group("check and export")
    group.add_argument("--name", metavar="PATTERN", help="whose a capture is: '{vehicle}/{date}/*.log.gz'")
    group.add_argument("--names", metavar="FILE.csv", help="the same, from columns url, vehicle and date")
    group.add_argument("--scheduler", metavar="ADDRESS", help="of Dask (tcp://...); default: workers here")
    group.add_argument("--workers", type=_count, metavar="N", help="here (one a core); 0: this process alone")
    group.add_argument("--memory", default="2GiB", metavar="SIZE", help="of a worker on this machine (2GiB)")
    group.add_argument("--retry", choices=("failed",), metavar="failed", help="try again what has no verdict")
    group.add_argument("--attempts", type=options.positive, default=4, metavar="N", help="for storage that fails (4)")
    group.add_argument("--table", action="append", default=[], metavar="NAME", help="export: a table; repeatable")
    group.add_argument("--partition", default="", metavar="NAMES", help="export: folders by vehicle,date")
    options.add_dissectors(group)
    rules.add_rules(parser).add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus")
    group = parser.add_argument_group("report")
    group.add_argument("--since", metavar="WHEN", help="what got worse since a day (2026-11-15) or for days (7d)")
    group.add_argument("--by", choices=("vehicle", "software", "rule", "esc"), help="one table alone, all its rows")
    group.add_argument("--flights", type=options.positive, default=20, metavar="N", help="least of an ESC's (20)")
    group.add_argument("--html", metavar="FILE", help="as one page")
    group.add_argument("--json", metavar="FILE", help="everything; - is standard output")
    options.add_output(parser)
    of_one = {one.dest: one for one in reversed(parser._actions) if one.dest in _OF}  # noqa: SLF001 - no other way to ask
    parser.set_defaults(run=run, follow=False, of_one=of_one)


def _misplaced(args: argparse.Namespace) -> str:
    """Return what is wrong with options that an action does not take, or that exclude each other; empty for nothing."""
    for dest, option in args.of_one.items():
        if args.action not in _OF[dest] and getattr(args, dest) != option.default:
            return f"{option.option_strings[-1]} is an option of {' and '.join(_OF[dest])}, not of {args.action}"
    if args.scheduler is not None and args.workers is not None:
        return "--workers are those here, --scheduler has its own: one of them"
    return "only one of --html and --json can be standard output" if args.html == args.json == "-" else ""


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"not a number of workers: {text!r}")
    return int(text)


def run(args: argparse.Namespace) -> int:  # noqa: PLR0911 - each line of usage ends it
    """Do what the action says."""
    if lacking := [name for name in _NEEDED if find_spec(name) is None]:
        return status.usage(f"{', '.join(lacking)} not installed: pip install 'tailbyte[fleet]'", NAME)
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415
    from analyzer.fleet.cluster import ClusterError  # noqa: PLC0415
    from analyzer.fleet.listing import ListingError  # noqa: PLC0415
    from analyzer.fleet.store import StoreError  # noqa: PLC0415

    plain_arrow()
    works = args.action in {"check", "export"}
    if works and not (args.place and args.output):
        return status.usage(f"{args.action} needs captures, and a store: -o STORE", NAME)
    if not works and (len(args.place) != 1 or args.output):
        return status.usage(f"{args.action} takes one store, and no -o", NAME)
    if wrong := _misplaced(args):
        return status.usage(wrong, NAME)
    try:
        return _ACTIONS[args.action](args)
    except (StoreError, ClusterError, ListingError) as error:
        return status.damaged(error, NAME)
    except (LookupError, ValueError) as error:
        return status.usage(error, NAME)
    except OSError as error:
        return status.usage(f"{error.filename}: {error.strerror}" if error.filename else str(error), NAME)


def _check(args: argparse.Namespace) -> int:
    from analyzer.cli.fleet.work import check  # noqa: PLC0415

    return check(args)


def _export(args: argparse.Namespace) -> int:
    from analyzer.cli.fleet.work import export  # noqa: PLC0415

    return export(args)


def _report(args: argparse.Namespace) -> int:
    from analyzer.cli.fleet.answers import report  # noqa: PLC0415

    return report(args)


def _status(args: argparse.Namespace) -> int:
    from analyzer.cli.fleet.answers import tell_status  # noqa: PLC0415

    return tell_status(args)


def _compact(args: argparse.Namespace) -> int:
    from analyzer.cli.fleet.answers import compact  # noqa: PLC0415

    return compact(args)


_ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "check": _check,
    "export": _export,
    "report": _report,
    "status": _status,
    "compact": _compact,
}
