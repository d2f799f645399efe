"""Every command with its options; light enough for `--help`: a command's module is imported when it is named."""

from __future__ import annotations

import argparse
import re
import sys
from importlib import import_module
from os.path import lexists
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

from analyzer.app.process import streams
from analyzer.cli.status import USAGE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from _typeshed import SupportsWrite

# Modules of this package with `add(parser)`, and what they are for. Each has examples in usage/examples.py, a page of
# the manual, and a man page that tests/bench/man_pages.py makes of both.
COMMANDS = {
    "decode": "list or export the transfers of a capture",
    "view": "look through a capture: list, details, bytes, filters by a key, marks",
    "triage": "what happened: what broke first, why, and what to do next; also tailbyte CAPTURE alone",
    "info": "summary of a capture: lines, nodes, types, rates",
    "stats": "rates, talkers, periods, loads, services as tables",
    "events": "the flights of a capture, and what happened in them",
    "check": "judge captures by all rules of the protocol",
    "diff": "what is different between two captures, the worst first",
    "explain": "what a rule of check means, or a clause, type, field or word of the document",
    "fields": "names of fields for filters and -e: type, unit, values",
    "convert": "captures as candump text, MCAP or pcapng",
    "export": "decoded tables as Parquet, Arrow, CSV or MCAP",
    "plot": "the picture of a flight, in the Rerun viewer",
    "fleet": "thousands of captures: judge, export, report; folders, S3, GCS, Azure",
    "live": "watch, record and judge a bus",
    "replay": "send a capture on a bus once more",
    "simulate": "traffic with known faults, to a file or a bus",
    "help": "pages of the manual: captures, check, live, ...",
    "completion": "what makes a shell complete commands, options, fields, types, rules and captures",
}

_LETTER = re.compile(r"-\d")  # an option of other programs

_EPILOG = """\
exit status: 0 done, 1 check has findings, 2 wrong usage, 3 capture unreadable or damaged (what was readable has been
shown) or output not writable, 4 check had nothing to judge, 130 interrupted. Results go to standard output,
everything else to standard error. `tailbyte help` lists the pages of the manual."""


def _unasked(prog: str) -> argparse.HelpFormatter:
    """Return what argparse tries each option on: nobody reads it, so that it asks for no terminal."""
    return argparse.HelpFormatter(prog, width=80)


class Parser(argparse.ArgumentParser):
    """Errors in one line, with the hint that a slip of the fingers deserves."""

    command = ""
    words: Sequence[str] = ()  # all that was given, for hints; of a command if that was not named
    commands: Mapping[str, Parser] = MappingProxyType({})
    _mixed = False

    def __init__(self, **more: Any) -> None:
        super().__init__(**more, formatter_class=_unasked)

    def fill(self) -> None:
        """Add what the module of the command says, once."""
        command, self.command = self.command, ""
        if command:
            import_module(f"analyzer.cli.{command}").add(self)

    def format_help(self) -> str:
        """Return the help, with examples at its end."""
        from analyzer.cli.usage.layout import Layout, examples  # noqa: PLC0415 - only those who ask wait for it

        self.formatter_class = Layout
        shown = examples("" if self._subparsers is not None else self.prog.rpartition(" ")[2])
        return f"{super().format_help()}\n{shown}\n" if shown else super().format_help()

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Write the help; the inherited one keeps quiet when it cannot write."""
        (file or sys.stdout).write(self.format_help())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse: a command takes its files and options in any order; the inherited one wants all files side by side."""
        self.fill()
        if self._subparsers is not None:
            self._check_order()
        if self._subparsers is not None or self._mixed:
            return super().parse_known_args(args, namespace)
        self._mixed = True  # the other method calls this one, twice
        try:
            known, others = self.parse_known_intermixed_args(args, namespace)
        finally:
            self._mixed = False
        others = others or [word for word in self._arguments(known) if _LETTER.fullmatch(word) and not lexists(word)]
        if others:
            from analyzer.cli.usage import hints  # noqa: PLC0415 - only those who slip wait for it

            self.error(hints.option(others[0], self, every_command(), self.words))
        return known, others

    def _arguments(self, known: argparse.Namespace) -> Iterator[str]:
        """Yield what is taken for files and the like: argparse takes a digit behind a minus for a number."""
        for action in self._get_positional_actions():
            value = getattr(known, action.dest, None)
            yield from (word for word in (value if isinstance(value, list) else [value]) if isinstance(word, str))

    def _match_argument(self, action: argparse.Action, arg_strings_pattern: str) -> int:
        """Say what an option needs that stands there without its value."""
        try:
            return super()._match_argument(action, arg_strings_pattern)
        except argparse.ArgumentError as error:
            if action.nargs is not None or not action.option_strings:
                raise
            from analyzer.cli.usage import hints  # noqa: PLC0415 - as above

            raise argparse.ArgumentError(action, hints.missing(action)) from error

    def _check_order(self) -> None:
        """Say where an option belongs that stands in front of the command."""
        first, *others = self.words or ("",)
        if len(first) > 1 and first[0] == "-" and not any(own.startswith(first) for own in self._option_string_actions):
            from analyzer.cli.usage import hints  # noqa: PLC0415 - as above

            self.error(hints.before_command(first, others, every_command()))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Say of a choice that does not exist which one may be meant."""
        if action.choices is None or value in action.choices:
            return
        from analyzer.cli.usage import hints  # noqa: PLC0415 - as above

        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - argparse has no other name for it
            self.error(hints.command(value, self.words, action.choices))
        raise argparse.ArgumentError(action, hints.choice(value, action.choices))

    def error(self, message: str) -> NoReturn:
        """Say one line and end with the status for wrong usage; who is told what to type needs no help beside it."""
        streams.complain(message if message.endswith("?") else f"{message} (see {self.prog} --help)", self.prog)
        raise SystemExit(USAGE)


def every_command(main_parser: Parser | None = None) -> Mapping[str, Parser]:
    """Return the commands by their names, all of them with their options."""
    commands = (main_parser or parser()).commands
    for command in commands.values():
        command.fill()
    return commands


class Version(argparse.Action):
    """Looks the version up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        """Print it and exit."""
        from analyzer.app.version import version  # noqa: PLC0415

        sys.stdout.write(f"tailbyte {version()}\n")
        parser.exit()


def parser(words: Sequence[str] = ()) -> Parser:
    """Return every command, or the one that `words` begin with, which will be parsed and are for hints, too."""
    main_parser = Parser(
        prog="tailbyte",
        description="Bus analyzer and log decoder for TM-UAVCAN V2.2 (T-Motor's DroneCAN profile).",
        epilog=_EPILOG,
    )
    main_parser.words = words
    main_parser.add_argument("--version", action=Version, nargs=0, help="show the version and exit")
    commands = main_parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=Parser, prog=main_parser.prog
    )  # fmt: skip
    for name in words[:1] if COMMANDS.keys() & {*words[:1]} else COMMANDS:
        commands.add_parser(name, help=COMMANDS[name]).command = name
    main_parser.commands = commands.choices
    return main_parser
