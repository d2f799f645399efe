"""`tailbyte help`: the pages of the manual, which come with the installation."""

from __future__ import annotations

import re
import shutil
import sys
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options

if TYPE_CHECKING:
    import argparse

NAME = "tailbyte help"
_INDEX = "README"
_WIDTH = 80
_TOPIC = re.compile(r"^\| \[([a-z-]+)\]\(\1\.md\) \|", re.MULTILINE)
_RULE = re.compile(r"[a-z]+-\d+", re.IGNORECASE)
# Commands that share the page of another topic.
_PAGES = {"explain": "rules", "fields": "filter", "help": _INDEX}


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] [TOPIC]"
    parser.description = __doc__
    parser.add_argument("topic", nargs="?", metavar="TOPIC", help="a page, or a command; without it, the list of all")
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


def run(args: argparse.Namespace) -> int:
    """Print a page."""
    from analyzer.cli.commands import COMMANDS  # noqa: PLC0415
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.views.page.markdown import render  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415

    topic = "help" if args.topic is None else args.topic.lower()
    page = _PAGES.get(topic, topic)
    try:
        known = topics()
        if page not in (_INDEX, *known):
            return _unknown(args.topic, known)
        text = _read(page)
    except (OSError, ValueError) as error:
        return status.damaged(f"the manual of this installation is not whole: {error}", NAME)
    if topic in COMMANDS and page != _INDEX:
        text += f"\nAll options: `tailbyte {topic} --help`.\n"
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _WIDTH
    with paged(wanted=not args.no_pager) as out:
        out.write(render(text, width=width, palette=Palette(options.colour(args))))
    return status.OK


def _read(page: str) -> str:
    """Return the Markdown of a page. Raises `OSError` or `ValueError` if it cannot be had."""
    from importlib.resources import files  # noqa: PLC0415 - takes longer than all of `--help`

    return files("analyzer").joinpath("manual", f"{page}.md").read_text("utf-8")


def topics() -> list[str]:
    """Return what `tailbyte help` takes. Raises `OSError` or `ValueError` if the manual is not there."""
    return [*_TOPIC.findall(_read(_INDEX)), *_PAGES]


def _unknown(topic: str, topics: list[str]) -> int:
    from difflib import get_close_matches  # noqa: PLC0415

    begun = [name for name in topics if topic and name.startswith(topic.lower())]
    near = [f"tailbyte help {name}" for name in begun or get_close_matches(topic.lower(), topics)]
    if _RULE.fullmatch(topic):
        near = [f"tailbyte explain {topic.upper()}"]
    hint = f"did you mean {' or '.join(near)}?" if near else "tailbyte help lists all"
    return status.usage(f"no page {topic!r}; {hint}", NAME)
