"""`tailbyte plot`: what every device did, what was commanded, where the protocol broke: on one time axis, in Rerun.

With no option it opens Rerun's viewer; without a display it writes the recording beside the capture.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, USAGE, options, streams
from analyzer.cli.plot_drawing import Drawing, name

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.cli.plot_viewer import Server
    from analyzer.plot.output import Output
    from analyzer.plot.picture import Picture
    from analyzer.window import Window

    Opened = tuple[Output, str]  # and what it is called

SUFFIX = ".rrd"


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser(
        "plot",
        help="the picture of a flight, in the Rerun viewer",
        description=__doc__,
        usage="%(prog)s [options] CAPTURE... [-o FILE.rrd | --serve | --connect URL]",
    )
    options.add_reader(parser)
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
        "--max-points", type=options.positive, metavar="N",
        help="of each line: the lowest and the highest of so many in a row, so that no peak is lost",
    )  # fmt: skip
    parser.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    options.add_dialect(parser)
    options.add_window(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Reads the captures once. A file is there whole or not at all; a viewer gets what there is as it comes."""
    from analyzer.cli.start import plain_arrow  # noqa: PLC0415
    from analyzer.plot import LOG_LEVEL  # noqa: PLC0415

    os.environ.setdefault(LOG_LEVEL, "off")  # one clear line of ours instead
    if args.alone:
        plain_arrow()
    with ExitStack() as until_the_end:
        until_the_end.callback(gc.enable)
        gc.disable()  # while Rerun is imported: 100,000 objects that live as long as the program
        try:
            window = options.window(args)
            goal = _goal(args, until_the_end)
        except (argparse.ArgumentTypeError, ValueError) as error:
            streams.complain(str(error), "tailbyte plot")
            return USAGE
        except _UnreachedError as error:
            streams.complain(str(error), "tailbyte plot")
            return DAMAGED
        status = goal.draw(args, window)
        return goal.last(status)


class _UnreachedError(Exception):
    """Where the recording was to go there is nobody."""


class _Goal:
    """Where a recording goes: `opened` opens it, in a stack that ends when everything has been sent."""

    def __init__(self, opened: Callable[[ExitStack], Opened], hint: str = "", server: Server | None = None) -> None:
        self._opened, self._hint, self._server = opened, hint, server
        self._drawn = False

    def draw(self, args: argparse.Namespace, window: Window) -> int:
        """Reads, judges and draws; the exit status."""
        from analyzer.cli.session import Session  # noqa: PLC0415

        with Session(args) as session:
            try:
                drawing = Drawing(args, session, window)
            except ValueError as error:
                streams.complain(str(error), "tailbyte plot")
                return USAGE
            with ExitStack() as stack:
                drawing.start()
                output, words = self._opened(stack)
                gc.freeze()
                gc.enable()
                picture = drawing.draw(output.send)
                output.layout(picture.layout())
                session.go_on()
            self._drawn = True
            session.release()
            streams.tell(f"-- {_amount(picture)} {words}\n{self._hint}")
            session.account(None)
        return session.status

    def last(self, status: int) -> int:
        """What is left to do once that is done; the exit status."""
        if self._server is not None and self._drawn:
            from analyzer.cli.plot_viewer import NoViewerError  # noqa: PLC0415

            try:
                self._server.wait(lambda: streams.tell("-- Ctrl-C ends it\n"))
            except NoViewerError as error:
                streams.complain(str(error), "tailbyte plot")
                return DAMAGED
        return status


def _goal(args: argparse.Namespace, until_the_end: ExitStack) -> _Goal:
    """Where to. Raises `ValueError` for arguments that do not go together, and `_UnreachedError`."""
    from analyzer.cli import plot_viewer as viewer  # noqa: PLC0415

    if not args.serve and (args.port is not None or args.bind is not None):
        raise ValueError("--port and --bind go with --serve")
    if not all(name == "-" or Path(name).exists() for name in options.captures(args)):
        return _file(args, args.output or _beside(args))  # whoever reads it will complain: no viewer for that
    if args.connect is not None:
        return _connected(args, args.connect, "shown by")
    if args.serve:
        until_the_end.enter_context(viewer.cleaning())
        try:
            server = viewer.Server(viewer.address(args.bind or viewer.LOOPBACK), args.port)
        except viewer.NoViewerError as error:
            raise _UnreachedError(str(error)) from None
        until_the_end.callback(server.close)
        sys.stdout.write(f"{server.url}\n")
        sys.stdout.flush()
        return _connected(args, server.local, "served, to viewers also at", server)
    if args.output is not None:
        return _file(args, args.output)
    if viewer.display() and viewer.binary() is not None:
        try:
            return _connected(args, str(viewer.window()), "shown by")
        except viewer.NoViewerError as error:
            streams.complain(f"{error}: a file it is", "tailbyte plot")
    return _file(args, _beside(args), hint=True)


def _connected(args: argparse.Namespace, url: str, words: str, server: Server | None = None) -> _Goal:
    """A viewer, there already or not."""
    from analyzer.plot.address import Address  # noqa: PLC0415

    address = Address.parse(url)
    try:
        address.probe()
    except OSError as error:
        raise _UnreachedError(f"{address}: no viewer is there ({error.strerror or error})") from None

    def opened(stack: ExitStack) -> Opened:
        from analyzer.plot.viewer import ViewerOutput  # noqa: PLC0415 - Rerun takes its time

        return stack.enter_context(ViewerOutput(address, name(args))), f"{words} {address}"

    return _Goal(opened, server=server)


def _file(args: argparse.Namespace, path: str, *, hint: bool = False) -> _Goal:
    """A file, or standard output. Raises `ValueError` when it is a terminal or the capture itself."""
    if path == "-" and sys.stdout.isatty():
        raise ValueError("a recording is nothing for a terminal: give -o FILE.rrd")
    options.refuse_input(args, path)

    def opened(stack: ExitStack) -> Opened:
        from analyzer.plot.output import FileOutput  # noqa: PLC0415 - Rerun takes its time
        from analyzer.sinks.atomic import Target  # noqa: PLC0415
        from analyzer.views.terminal import escape  # noqa: PLC0415

        target = stack.enter_context(Target(path))
        return stack.enter_context(FileOutput(target.file, name(args))), f"written to {escape(target.name)}"

    return _Goal(opened, _how_to_open(path) if hint else "")


def _how_to_open(path: str) -> str:
    """For those who have no display here."""
    import shlex  # noqa: PLC0415

    from analyzer.views.terminal import escape  # noqa: PLC0415

    return f"-- to open it where there is a display: rerun {escape(shlex.quote(path))}; in a browser: plot --serve\n"


def _beside(args: argparse.Namespace) -> str:
    """The file beside the first capture. Raises `ValueError` if there is none."""
    first = options.captures(args)[0]
    if first == "-":
        raise ValueError("standard input has no name: give -o FILE.rrd")
    return str(Path(first).with_name(name(args) + SUFFIX))


def _amount(picture: Picture) -> str:
    lines = [one for one in picture.inventory.series.values() if one.kind == "line"]
    return f"{len(lines)} lines with {sum(one.count for one in lines)} points"


def _port(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) < 1 << 16:
        raise argparse.ArgumentTypeError(f"{text!r} is no port (1 to 65535)")
    return int(text)
