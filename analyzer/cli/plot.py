"""`tailbyte plot`: what every device did, what was commanded, where the protocol broke: on one time axis, in Rerun.

With no option it opens Rerun's viewer; without a display it writes the recording beside the capture.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.app.targets import refuse_input
from analyzer.cli import status
from analyzer.cli.arguments import options
from analyzer.plot import MOST_POINTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.app.request import Request
    from analyzer.plot.output import Output
    from analyzer.plot.picture import Picture
    from analyzer.plot.serving.server import Server

    Opened = tuple[Output, str]  # and what it is called

NAME = "tailbyte plot"
SUFFIX = ".rrd"


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE... [-o FILE | --serve | --connect URL]"
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    where = parser.add_argument_group(
        "where to", "default: a window of the viewer; without a display, a file beside the capture with its name"
    ).add_mutually_exclusive_group()
    where.add_argument("-o", "-w", dest="output", metavar="FILE.rrd", help="the recording; - is standard output")
    where.add_argument(
        "--serve", action="store_true",
        help="pages for a browser on this computer, until Ctrl-C; prints their address",
    )  # fmt: skip
    where.add_argument(
        "--connect", metavar="URL",
        help="a viewer that runs: rerun+http://127.0.0.1:9876/proxy, HOST:PORT, or PORT",
    )  # fmt: skip
    served = parser.add_argument_group("for --serve")
    served.add_argument("--port", type=_port, metavar="N", help="of the pages (default: 9090, or any that is free)")
    served.add_argument(
        "--bind", metavar="ADDRESS", help="default: 127.0.0.1; 0.0.0.0 shows it to everybody on the network"
    )
    parser.add_argument(
        "--max-points", type=_most, metavar="N",
        help=f"of each line: the lowest and the highest of so many in a row, so that no peak is lost; all for all "
        f"points (default: {MOST_POINTS}, and all of what comes live)",
    )  # fmt: skip
    parser.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    options.add_dialect(parser)
    options.add_filter(parser)
    options.add_window(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read the captures once. A file is there whole or not at all; a viewer gets what there is as it comes."""
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415
    from analyzer.app.request import RuleChoice  # noqa: PLC0415
    from analyzer.plot import LOG_LEVEL  # noqa: PLC0415

    os.environ.setdefault(LOG_LEVEL, "off")  # one clear line of ours instead
    plain_arrow()
    with ExitStack() as until_the_end:
        until_the_end.callback(gc.enable)
        gc.disable()  # while Rerun is imported: 100,000 objects that live as long as the program
        try:
            rules = RuleChoice(bit_rate=args.bitrate, dialects=tuple(args.dialect))
            request = replace(options.request(args, NAME), rules=rules)
            asked = _Asked(request, args.output, args.connect, args.serve, args.bind, args.port)
            goal = _goal(asked, until_the_end)
        except (argparse.ArgumentTypeError, ValueError) as error:
            return status.usage(error, NAME)
        except _UnreachedError as error:
            return status.damaged(error, NAME)
        return goal.last(goal.draw(request, args.max_points))


class _UnreachedError(Exception):
    """Where the recording was to go there is nobody."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """The captures, and where their picture is to go."""

    request: Request
    output: str | None
    connect: str | None
    serve: bool
    bind: str | None
    port: int | None

    @property
    def name(self) -> str:
        """The name of the recording."""
        from analyzer.app.drawing import name  # noqa: PLC0415

        return name(self.request)

    @property
    def beside(self) -> str:
        """The file beside the first capture. Raises `ValueError` if there is none."""
        first = self.request.names[0]
        if first == "-":
            raise ValueError("standard input has no name: give -o FILE.rrd")
        return str(Path(first).with_name(self.name + SUFFIX))


class _Serving:
    """Work that Ctrl-C ends at once."""

    stopped = False
    waits = True


class _Goal:
    """Where a recording goes: `opened` opens it, in a stack that ends when everything has been sent."""

    def __init__(self, opened: Callable[[ExitStack], Opened], hint: str = "", server: Server | None = None) -> None:
        self._opened, self._hint, self._server = opened, hint, server
        self._drawn = False

    def draw(self, request: Request, most_points: int | None) -> int:
        """Read, judge and draw; return the exit status."""
        from analyzer.app.drawing import Drawing  # noqa: PLC0415
        from analyzer.cli.complaints import Complaints  # noqa: PLC0415
        from analyzer.cli.reading import account, reading, watched  # noqa: PLC0415

        complaints = Complaints()
        with reading(request, complaints) as run:
            try:
                drawing = Drawing(run, most_points)
            except ValueError as error:
                return status.usage(error, NAME)
            with ExitStack() as stack:
                drawing.start()
                output, words = self._opened(stack)
                gc.freeze()
                gc.enable()
                with watched(run.source, complaints) as progress:
                    picture = drawing.draw(output.send, progress.over)
                drawing.finish(picture)
                output.layout(picture.layout())
                run.go_on()
            self._drawn = True
            streams.tell(f"-- {_amount(picture)} {words}\n{_how_to_see_all(picture)}{self._hint}")
            account(run, None)
        return status.of_run(run)

    def last(self, done: int) -> int:
        """Do what is left once that is `done`; return the exit status."""
        if self._server is not None and self._drawn:
            from analyzer.app.process.interrupt import graceful  # noqa: PLC0415
            from analyzer.plot.viewer_program import NoViewerError  # noqa: PLC0415
            from analyzer.sources.errors import StopReading  # noqa: PLC0415

            try:
                with suppress(StopReading, KeyboardInterrupt), graceful(_Serving):
                    self._server.wait(lambda: streams.tell("-- Ctrl-C ends it\n"))
            except NoViewerError as error:
                return status.damaged(error, NAME)
        return done


def _goal(asked: _Asked, until_the_end: ExitStack) -> _Goal:
    """Return where to. Raises `ValueError` for arguments that do not go together, and `_UnreachedError`."""
    from analyzer.app.process.interrupt import cleaning  # noqa: PLC0415
    from analyzer.plot import viewer_program as viewer  # noqa: PLC0415

    if not asked.serve and (asked.port is not None or asked.bind is not None):
        raise ValueError("--port and --bind go with --serve")
    if not all(name == "-" or Path(name).exists() for name in asked.request.names):
        return _file(asked, asked.output or asked.beside)  # whoever reads it will complain: no viewer for that
    if asked.connect is not None:
        return _connected(asked, asked.connect, "shown by")
    if asked.serve:
        from analyzer.plot.serving.server import Server  # noqa: PLC0415

        until_the_end.enter_context(cleaning())
        try:
            server = Server(viewer.address(asked.bind or viewer.LOOPBACK), asked.port)
        except viewer.NoViewerError as error:
            raise _UnreachedError(str(error)) from None
        until_the_end.callback(server.close)
        sys.stdout.write(f"{server.url}\n")
        sys.stdout.flush()
        return _connected(asked, server.local, "served, to viewers also at", server)
    if asked.output is not None:
        return _file(asked, asked.output)
    if viewer.display() and viewer.binary() is not None:
        try:
            return _connected(asked, str(viewer.window()), "shown by")
        except viewer.NoViewerError as error:
            streams.complain(f"{error}: a file it is", NAME)
    return _file(asked, asked.beside, hint=True)


def _connected(asked: _Asked, url: str, words: str, server: Server | None = None) -> _Goal:
    """Return a viewer, there already or not."""
    from analyzer.plot.address import Address  # noqa: PLC0415

    address = Address.parse(url)
    try:
        address.probe()
    except OSError as error:
        raise _UnreachedError(f"{address}: no viewer is there ({error.strerror or error})") from None

    def opened(stack: ExitStack) -> Opened:
        from analyzer.plot.viewer import ViewerOutput  # noqa: PLC0415 - Rerun takes its time

        shown = address if server is None else server.public
        return stack.enter_context(ViewerOutput(address, asked.name)), f"{words} {shown}"

    return _Goal(opened, server=server)


def _file(asked: _Asked, path: str, *, hint: bool = False) -> _Goal:
    """Return a file, or standard output. Raises `ValueError` when it is a terminal or the capture itself."""
    if path == "-" and sys.stdout.isatty():
        raise ValueError("a recording is nothing for a terminal: give -o FILE.rrd")
    refuse_input(asked.request.names, path)

    def opened(stack: ExitStack) -> Opened:
        from analyzer.plot.output import FileOutput  # noqa: PLC0415 - Rerun takes its time
        from analyzer.sinks.atomic import Target  # noqa: PLC0415
        from analyzer.views.terminal import escape  # noqa: PLC0415

        target = stack.enter_context(Target(path))
        return stack.enter_context(FileOutput(target.file, asked.name)), f"written to {escape(target.name)}"

    return _Goal(opened, _how_to_open(path) if hint else "")


def _how_to_open(path: str) -> str:
    """Return words for those who have no display here."""
    import shlex  # noqa: PLC0415

    from analyzer.views.terminal import escape  # noqa: PLC0415

    return f"-- to open it where there is a display: rerun {escape(shlex.quote(path))}; in a browser: plot --serve\n"


def _amount(picture: Picture) -> str:
    lines = [one for one in picture.inventory.series.values() if one.kind == "line"]
    points = sum(one.count for one in lines)
    lost = sum(one.count - one.left for one in picture.thinned().values())
    return f"{len(lines)} lines with {f'{points - lost} of ' if lost else ''}{points} points"


def _how_to_see_all(picture: Picture) -> str:
    """Return words for those who miss points."""
    thinned = len(picture.thinned())
    if not thinned:
        return ""
    return f"-- {thinned} lines are thinned, no peak is lost; --max-points all shows all, --around a part in full\n"


def _most(text: str) -> int:
    return 0 if text == "all" else options.positive(text)


def _port(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) < 1 << 16:
        raise argparse.ArgumentTypeError(f"{text!r} is no port (1 to 65535)")
    return int(text)
