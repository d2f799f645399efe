"""The command line: arguments -> source -> engine -> view. Exit codes are decided here and nowhere else.

Nothing heavy is imported before the arguments are known: `--help` has to be instant.
"""

from __future__ import annotations

import argparse
import signal
import sys
from typing import TYPE_CHECKING, Any, NoReturn

from analyzer.cli import streams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from _typeshed import SupportsWrite

OK, USAGE, DAMAGED, INTERRUPTED = 0, 2, 3, 130

_EPILOG = """\
exit status: 0 done, 1 check has findings, 2 wrong usage, 3 capture unreadable or damaged (what was readable has been
shown) or output not writable, 4 check had nothing to judge, 130 interrupted. Results go to standard output,
everything else to standard error."""


class Parser(argparse.ArgumentParser):
    """Errors in one line, with the hint that a slip of the fingers deserves."""

    _mixed = False

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """The inherited one keeps quiet when it cannot write."""
        (file or sys.stdout).write(self.format_help())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """A command takes its files and options in any order; the inherited one wants all files side by side."""
        if self._subparsers is not None or self._mixed:
            return super().parse_known_args(args, namespace)
        self._mixed = True  # the other method calls this one, twice
        try:
            return self.parse_known_intermixed_args(args, namespace)
        finally:
            self._mixed = False

    def error(self, message: str) -> NoReturn:
        """One line and exit status 2."""
        streams.complain(f"{message} (see {self.prog} --help)", self.prog)
        raise SystemExit(USAGE)


class Version(argparse.Action):
    """Looks the version up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        """Prints it and exits."""
        sys.stdout.write(f"tailbyte {version()}\n")
        parser.exit()


def parser() -> Parser:
    """Every command with its options; light enough for `--help`."""
    from analyzer.cli import check, convert, decode, explain, export, info, live, plot, replay, simulate  # noqa: PLC0415 - all are argparse only at this point

    main_parser = Parser(
        prog="tailbyte",
        description="Bus analyzer and log decoder for TM-UAVCAN V2.2 (T-Motor's DroneCAN profile).",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    main_parser.add_argument("--version", action=Version, nargs=0, help="show the version and exit")
    commands = main_parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    for command in (decode, info, check, explain, convert, export, plot, live, replay, simulate):
        command.add(commands)
    return main_parser


def version() -> str:
    """The installed version, `unknown` in a tree that was never installed."""
    from importlib.metadata import PackageNotFoundError  # noqa: PLC0415
    from importlib.metadata import version as installed  # noqa: PLC0415

    try:
        return installed("tailbyte")
    except PackageNotFoundError:
        return "unknown"


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status and never raises for anything a capture or a user can do."""
    try:
        streams.prepare()
        status = _run(argv)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        streams.forget(1)
        return OK
    except OSError as error:
        streams.forget(1)
        streams.complain(f"standard output: {error.strerror or error}")
        return DAMAGED
    return status


def _run(argv: Sequence[str] | None) -> int:
    try:
        args = parser().parse_args(argv)
        args.alone = argv is None  # nobody else uses this process
        if "capture" in args and not (args.capture or args.capture_):
            parser().error(f"{args.command}: which capture? give a file, or - for standard input")
        return int(args.run(args))
    except SystemExit as leave:  # argparse has said what there is to say
        return leave.code if isinstance(leave.code, int) else OK


def _interrupted() -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        sys.stdout.flush()
    except OSError:
        streams.forget(1)
    return INTERRUPTED
