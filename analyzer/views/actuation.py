"""The commands for devices that move, which would have been sent, as a small table."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def render(rows: Sequence[tuple[str, str, int]], seconds: float) -> str:
    """Write node, type, frames and frames per second of what was counted in so many seconds, 0 if nobody knows."""
    width = max(len("Type"), *(len(name) for _, name, _ in rows))
    lines = [f"{'Node':>6}  {'Type':<{width}}  {'Frames':>8}  {'Hz':>8}"]
    lines += [f"{node:>6}  {name:<{width}}  {count:>8}  {_rate(count, seconds):>8}" for node, name, count in rows]
    return "".join(f"{line}\n" for line in lines)


def _rate(count: int, seconds: float) -> str:
    return f"{count / seconds:.1f}" if seconds > 0 else "-"
