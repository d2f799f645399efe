"""The command line: arguments -> request -> run -> view. `status` decides the exit statuses, all of them.

Nothing heavy is imported before the arguments are known: `--help` has to be instant.
"""

from __future__ import annotations

import signal
import sys
from typing import TYPE_CHECKING

from analyzer.app.process import start, streams
from analyzer.cli.status import DAMAGED, INTERRUPTED, OK, USAGE

if TYPE_CHECKING:
    from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status and never raise for anything a capture or a user can do."""
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
    words = sys.argv[1:] if argv is None else argv
    if not words:
        from analyzer.cli.usage.first_steps import first_steps  # noqa: PLC0415

        streams.tell(first_steps())
        return USAGE
    from analyzer.cli.commands import COMMANDS, parser  # noqa: PLC0415 - Ctrl-C while it is imported is Ctrl-C, too
    from analyzer.cli.usage.front_door import triaged  # noqa: PLC0415

    typed, words = words, triaged(words, COMMANDS)

    if argv is None:  # nobody else uses this process
        start.alone()
    if "can" not in sys.modules:
        # python-can imports asammdf, and pandas with it, where it can: another process reads MDF 4.
        sys.modules.setdefault("asammdf", None)  # type: ignore[arg-type]  # what stands for "there is none"

    try:
        main_parser = parser(words)
        if words is not typed:
            main_parser.commands[words[0]].words = typed
        args = main_parser.parse_args(words)
        if "capture" in args and not (args.capture or args.capture_):
            main_parser.commands[args.command].error("which capture? give a file, or - for standard input")
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
