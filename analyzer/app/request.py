"""A request about captures: frozen data that every way in makes, and that one `Run` reads."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from analyzer.app.process.threads import THREADS
from analyzer.rules.catalogue import OWN, matching
from analyzer.rules.gate import Least
from analyzer.rules.settings import Settings
from analyzer.sources.merge import Plan
from analyzer.window.limits import Window
from dissectors.keys.pages import ORIGINS
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from analyzer.rules.catalogue import Page
    from analyzer.sources.origin import FileObject


@dataclass(frozen=True, slots=True)
class RuleChoice:
    """The rules and limits that somebody asks for.

    `select` and `ignore` name rules, layers or `all`; `origins` leaves only rules that these state. `fail_on` is what
    fails the gate, the default if it is empty; a capture with less than `least` is not judged. `bit_rate` is in bits
    per second, `dialects` are node IDs with a reading of their doubtful fields. `vehicle` is a vehicle file, `baseline`
    the JSON of an older report.
    """

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()
    fail_on: tuple[str, ...] = ()
    least: Least = Least()
    bit_rate: int | None = None
    dialects: tuple[tuple[int, str], ...] = ()
    vehicle: str | None = None
    baseline: str | None = None

    def settings(self, pages: Mapping[str, Page]) -> Settings:
        """Return the settings of the rules. Raises `LookupError`, or `ValueError` if no rule is left."""
        for origin in self.origins:
            if origin not in (*ORIGINS, OWN):
                raise ValueError(f"no rule has the origin {origin!r} (one of: {', '.join((*ORIGINS, OWN))})")
        select: Collection[str] | None = matching(self.select, pages) if self.select else None
        ignore = matching(self.ignore, pages)
        if self.origins:
            of = {rule for rule, page in pages.items() if page.origin in self.origins}
            select = {rule for rule in of if (pages[rule].enabled if select is None else rule in select)}
        settings = Settings(select=select, ignore=ignore, bit_rate=self.bit_rate)
        if not settings.enabled(pages):
            raise ValueError("no rule is left")
        return settings

    def readings(self) -> dict[int, list[str]]:
        """Return the readings of doubtful fields by node ID."""
        found: dict[int, list[str]] = {}
        for node, choice in self.dialects:
            found.setdefault(node, []).append(choice)
        return found

    def asked(self) -> dict[str, object]:
        """Return what was asked for, to be printed."""
        words = {"select": self.select, "ignore": self.ignore, "origin": self.origins}
        asked: dict[str, object] = {name: list(given) for name, given in words.items() if given}
        if self.dialects:
            asked["dialects"] = [f"{node}={choice}" for node, choice in self.dialects]
        if self.baseline is not None:
            asked["baseline"] = self.baseline
        return asked


@dataclass(frozen=True, slots=True)
class Request:
    """The wishes for captures.

    `captures` are paths or binary file objects, `-` is standard input; several are merged as `merging` says.
    `dissectors` are folders with further data types; Python of those that are `trusted` runs. `follow` waits at the end
    of a file for more. With one of `threads` everything is done one after the other; with more, captures that are files
    are decoded ahead of what judges, lists or writes them, and the result is the same.
    For reports: `window_words` are the limits of the window as they were asked for, `arguments`
    what a command line needs beside the names of captures to read them in the same way.
    `flight` is the number of one to which the window is narrowed when the captures are read, -1 for the last one.
    `filter` chooses rows: transfers, or with `frame_list` frames, whose numbers are Wireshark's if `wireshark` says so.
    """

    captures: tuple[str | FileObject, ...]
    merging: Plan = Plan()
    dissectors: tuple[Path, ...] = ()
    trusted: tuple[Path, ...] = ()
    window: Window = Window()
    rules: RuleChoice = RuleChoice()
    follow: bool = False
    threads: int = THREADS
    window_words: tuple[str, ...] = ()
    arguments: tuple[str, ...] = ()
    filter: str | None = None
    frame_list: bool = False
    wireshark: bool = False
    flight: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the captures."""
        return tuple(one if isinstance(one, str) else one.name for one in self.captures)

    def each(self) -> dict[str, Request]:
        """Return what is judged by itself, by its short name: every capture, or all of them as one if merged."""
        groups = [self.captures] if self.merging else [(capture,) for capture in self.captures]
        parts = [replace(self, captures=group) for group in groups]
        return dict(zip(short_names([part.names for part in parts]), parts, strict=True))

    @property
    def outside(self) -> str:
        """The complaint about a capture of which nothing is inside the window."""
        return ": ".join(filter(None, ("nothing is inside the window", " ".join(self.window_words))))

    def again(self) -> Iterator[str]:
        """Yield the arguments of a command line behind the first capture that read all of it in the same way."""
        yield from (f"./{name}" if name.startswith("-") and name != "-" else name for name in self.names[1:])
        yield from self.arguments


def short_names(groups: Sequence[Sequence[str]]) -> list[str]:
    """Return short names for captures, none of them twice: the last part of the path if that tells them apart."""
    short = ["+".join(PurePath(name).name or name for name in group) for group in groups]
    whole = ["+".join(group) for group in groups]
    found: list[str] = []
    for k, name in enumerate(short):
        wanted = name if short.count(name) == 1 else whole[k]
        found.append(wanted if wanted not in found else f"{wanted} ({k + 1})")
    return found
