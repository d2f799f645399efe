"""The first and the last line: what runs, what is recorded and lost; which keys there are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.terminal.figures import amount, clock, rate, size, span
from analyzer.views.terminal import display_width, escape, fit
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.board.snapshot import RecordingState, Snapshot
    from analyzer.terminal.sheet import Line, Span

# What is shown is told to be old from here on.
_BEHIND = 2 * SECOND
_KEYS = (
    "? help", "q quit", "space pause", "m mark", "w save", "v view", "s sort", "tab pane", "x min/max", "c clear",
    "e n b f l panes", "S reverse",
)  # fmt: skip


def top(snapshot: Snapshot | None, paused: int | None, width: int) -> Line:
    """Return interfaces, time, recording, load, losses; `paused` is how long the display has stood still, in ns.

    What is lost or broken comes first where it is narrow.
    """
    if snapshot is None:
        return _line([(" waiting for the bus", "bold")], [], width)
    buses = snapshot.buses
    names = " ".join(escape(bus.name) for bus in buses) or "no interface"
    left: list[Span] = [(f" {fit(names, max(8, width // 4))}", "bold"), (f" {clock(snapshot.now)}", "")]
    if paused is not None:
        left.append((f" PAUSED {span(paused)}", "alarm"))
    if snapshot.behind >= _BEHIND:
        left.append((f" BEHIND {span(snapshot.behind)}", "alarm"))
    left += _recording(snapshot.recording, width)
    lost = sum(bus.dropped + bus.here for bus in buses) + (snapshot.recording.lost if snapshot.recording else 0)
    right: list[Span] = []
    if buses:
        load = max(bus.load for bus in buses)
        right = [(f"  {rate(sum(bus.frames for bus in buses))} frames/s", ""), (f"  load {load:.0f}%", "")]
    found = snapshot.found
    right.append((f"  {found.errors} errors ", "bad" if found.errors else ""))
    right.append((f" LOST {amount(lost)} " if lost else " lost 0 ", "alarm" if lost else ""))
    return _line(left, right, width)


def _recording(state: RecordingState | None, width: int) -> list[Span]:
    if state is None:
        return [(" not recording", "warn")]
    if state.problem:
        return [(f" RECORDING STOPPED: {escape(state.problem)}", "alarm")]
    name = fit(escape(state.file.rpartition("/")[2]), max(12, width // 4))
    return [(" REC", "good"), (f" {name} {size(state.size)} {amount(state.frames)} fr", "")]


def bottom(message: str, width: int) -> Line:
    """Return what there is to tell, or else the keys, as many as there is room for."""
    if message:
        return _line([(f" {escape(message)}", "bold")], [], width)
    text = ""
    for key in _KEYS:
        if len(text) + len(key) + 3 > width:
            break
        text += f"  {key}" if text else f" {key}"
    return _line([(text, "dim")], [], width)


def _line(left: Sequence[Span], right: Sequence[Span], width: int) -> Line:
    """Join both sides; the left one gives way, and the first parts of the right one before its last."""
    kept = list(right)
    while len(kept) > 1 and _wide(kept) + _wide(left) > width:
        del kept[0]
    spans: list[Span] = []
    room = max(0, width - _wide(kept))
    for text, style in left:
        cut = fit(text, room)
        spans.append((cut, style))
        room -= display_width(cut)
    return (*spans, (" " * room, ""), *kept)


def _wide(spans: Sequence[Span]) -> int:
    return sum(display_width(text) for text, _ in spans)
