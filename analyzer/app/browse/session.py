"""One session of the browser, from opening the captures to the last key."""

from __future__ import annotations

import gc
import os
import sys
from typing import TYPE_CHECKING, NamedTuple

from analyzer.app.browse.capture import CaptureSupply
from analyzer.app.browse.tools import BrowserTools, kept_columns, kept_filters
from analyzer.browser.own_columns import OwnColumns
from analyzer.browser.store.folder import StoreFolder
from analyzer.browser.view import BrowserView
from analyzer.facts.frame_marks import MarkBook, marks_path, read_marks
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.app.request import Request
    from analyzer.browser.screen.app import Browser
    from analyzer.browser.supply import Supply
    from analyzer.views.colours.rules import ColourRule

_PATIENCE = 2.0  # seconds until captures are shown of which nothing has come so far
_TURN = 0.001  # seconds until keys get their turn while threads decode and judge


@dataclass(frozen=True, slots=True)
class BrowseOptions:
    """How captures are to be looked at.

    `at` is a frame or a time, `time` a form of times as `-t` has it, `columns` are fields beside the kept ones,
    `marks` says that marks are kept beside the capture; `colour` that there are colours.
    """

    at: str = ""
    filter: str = ""
    time: str = "r"
    columns: tuple[str, ...] = ()
    marks: bool = True


class Browsed(NamedTuple):
    """The end of a session: the return code of the display, what was complained of, what failed or was refused."""

    code: int
    notes: Sequence[str]
    failed: bool
    refused: bool


def browse(request: Request, options: BrowseOptions, rules: Sequence[ColourRule]) -> Browsed:
    """Show captures until the user quits.

    Raises `FilterError`, `LookupError` or `ValueError` for options that make no sense, `CaptureError` for a capture
    that cannot be opened, `OSError` if there is no room for the store.
    """
    sys.setswitchinterval(_TURN)
    while True:
        with StoreFolder() as folder:
            supply = CaptureSupply(request, folder.path)
            supply.start()
            try:
                app = made(supply, options, rules)
                if not supply.opens(_PATIENCE):
                    return Browsed(0, supply.notes, supply.failed, supply.refused)
                gc.freeze()  # of what is there for good a collection costs as much as ten keys
                app.run()
            finally:
                supply.stop()
                supply.join()
        if not app.reload:
            return Browsed(app.return_code or 0, supply.notes, supply.failed, supply.refused)
        request = replace(request, follow=False)  # what was followed is judged now
        row, pages = app.view.current(), app.view.pages
        options = replace(
            options, at="" if row is None else f"#{row.place + 1}", filter=app.view.filter, time=pages.mode,
            columns=() if pages.columns is None else pages.columns.names,
        )  # fmt: skip


def made(supply: Supply, options: BrowseOptions, rules: Sequence[ColourRule]) -> Browser:
    """Return the display. Raises what options raise that make no sense."""
    from analyzer.browser.screen.app import Browser  # noqa: PLC0415 - Textual takes a third of a second

    book = MarkBook(None)
    only = supply.paths[0] if len(supply.paths) == 1 and os.path.isfile(supply.paths[0]) else ""  # noqa: PTH113
    if options.marks and supply.recorded:
        book = MarkBook(marks_path(supply.recorded))  # those of an older recording are none of this one
    elif options.marks and only:
        book = MarkBook(marks_path(only))
        book.marks = read_marks(marks_path(only))
    view = BrowserView(supply, rules, book)
    view.pages.mode = options.time
    waits = view.waits(options.filter)
    if options.filter and not waits:
        view.apply(options.filter)
    names = list(options.columns)
    if not names:
        names = [name for name in kept_columns() if _exists(supply, name)]
    if names:
        view.pages.columns = OwnColumns(supply.store, supply.registry, names)
    encoding = (getattr(sys.__stdout__, "encoding", None) or "ascii").lower().replace("-", "")
    app = Browser(view, BrowserTools(supply), options.at, plain=not encoding.startswith("utf"))
    app.awaited = options.filter if waits else ""
    for text in kept_filters():
        app.bar.keep(text)
    return app


def _exists(supply: Supply, name: str) -> bool:
    """Return whether a kept column exists with the types of today."""
    try:
        OwnColumns(supply.store, supply.registry, [name])
    except (LookupError, ValueError):
        return False
    return True
