"""How full a bus is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.conformance import SECOND, Occurrence, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.load import Second
    from analyzer.rules.view import View
    from dissectors.conformance import View as AnyView


class HighLoad(Watcher):
    """BUS-004: a second with more bits than a share of the bit rate."""

    rules = ("BUS-004",)

    def __init__(self) -> None:
        self._open: dict[int, Second] = {}

    def look(self, view: View) -> Iterator[Occurrence]:  # type: ignore[override]  # only the analyzer knows seconds
        """Judges the seconds that a later one of the same interface has ended."""
        if view.bit_rate is None:
            return
        for one in view.seconds:
            last = self._open.get(one.bus)
            if last is not None and last.start == one.start:
                self._open[one.bus] = last._replace(frames=last.frames + one.frames, bits=last.bits + one.bits)
                continue
            self._open[one.bus] = one
            if last is not None:
                yield from _judged(view, last)

    def settle(self, view: AnyView) -> Iterator[Occurrence]:
        """Judges the last second of each interface."""
        for one in self._open.values():
            yield from _judged(view, one)


def _judged(view: AnyView, one: Second) -> Iterator[Occurrence]:
    load = 100 * one.bits / (view.bit_rate or SECOND)
    limits = [view.number("BUS-004", name) for name in ("first_pct", "second_pct")]
    passed = [limit for limit in limits if load > limit]
    if passed:
        values = {"load_pct": load, "limit_pct": max(passed)}
        yield Occurrence("BUS-004", one.t, one.bus, None, "", (one.frame,), values)


WATCHERS: tuple[type[Watcher], ...] = (HighLoad,)
