"""Every command with its options; light enough for `--help`: a command's module is imported when it is named."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any, NoReturn

from analyzer.app import streams
from analyzer.cli.status import USAGE

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

# Modules of this package with `add(parser)`, and what they are for.
COMMANDS = {
    "decode": "list or export the transfers of a capture",
    "info": "summary of a capture: lines, nodes, types, rates",
    "check": "judge captures by all rules of the protocol",
    "explain": "what a rule of check means, or a clause, type, field or word of the document",
    "convert": "captures as candump text, MCAP or pcapng",
    "export": "decoded tables as Parquet, Arrow, CSV or MCAP",
    "plot": "the picture of a flight, in the Rerun viewer",
    "live": "watch, record and judge a bus",
    "replay": "send a capture on a bus once more",
    "simulate": "traffic with known faults, to a file or a bus",
    "help": "pages of the manual: captures, check, live, ...",
}

_EPILOG = """\
exit status: 0 done, 1 check has findings, 2 wrong usage, 3 capture unreadable or damaged (what was readable has been
shown) or output not writable, 4 check had nothing to judge, 130 interrupted. Results go to standard output,
everything else to standard error. `tailbyte help` lists the pages of the manual."""


class Parser(argparse.ArgumentParser):
    """Errors in one line, with the hint that a slip of the fingers deserves."""

    command = ""
    _mixed = False

    def fill(self) -> None:
        """Add what the module of the command says, once."""
        command, self.command = self.command, ""
        if command:
            import_module(f"analyzer.cli.{command}").add(self)

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Write the help; the inherited one keeps quiet when it cannot write."""
        (file or sys.stdout).write(self.format_help())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse: a command takes its files and options in any order; the inherited one wants all files side by side."""
        self.fill()
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
        from analyzer.app.version import version  # noqa: PLC0415

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
    for name, about in COMMANDS.items():
        commands.add_parser(name, help=about).command = name
    return main_parser
