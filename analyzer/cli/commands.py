"""Every command with its options; light enough for `--help`."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any, NoReturn

from analyzer.app import streams
from analyzer.app.version import version
from analyzer.cli import check, convert, decode, explain, export, info, live, plot, replay, simulate
from analyzer.cli import help as manual
from analyzer.cli.status import USAGE

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

_EPILOG = """\
exit status: 0 done, 1 check has findings, 2 wrong usage, 3 capture unreadable or damaged (what was readable has been
shown) or output not writable, 4 check had nothing to judge, 130 interrupted. Results go to standard output,
everything else to standard error. `tailbyte help` lists the pages of the manual."""


class Parser(argparse.ArgumentParser):
    """Errors in one line, with the hint that a slip of the fingers deserves."""

    _mixed = False

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Write the help; the inherited one keeps quiet when it cannot write."""
        (file or sys.stdout).write(self.format_help())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse: a command takes its files and options in any order; the inherited one wants all files side by side."""
        if self._subparsers is not None or self._mixed:
            return super().parse_known_args(args, namespace)
        self._mixed = True  # the other method calls this one, twice
        try:
            return self.parse_known_intermixed_args(args, namespace)
        finally:
            self._mixed = False

    def error(self, message: str) -> NoReturn:
        """Say one line and end with the status for wrong usage."""
        streams.complain(f"{message} (see {self.prog} --help)", self.prog)
        raise SystemExit(USAGE)


class Version(argparse.Action):
    """Looks the version up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        """Print it and exit."""
        sys.stdout.write(f"tailbyte {version()}\n")
        parser.exit()


def parser() -> Parser:
    """Return every command with its options."""
    main_parser = Parser(
        prog="tailbyte",
        description="Bus analyzer and log decoder for TM-UAVCAN V2.2 (T-Motor's DroneCAN profile).",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    main_parser.add_argument("--version", action=Version, nargs=0, help="show the version and exit")
    commands = main_parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    for command in (decode, info, check, explain, convert, export, plot, live, replay, simulate, manual):
        command.add(commands)
    return main_parser
