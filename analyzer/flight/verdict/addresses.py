"""Two devices with one node ID, or one index."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.thresholds import threshold
from analyzer.flight.verdict.trouble import Trouble

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.supply.extents import EscExtent
    from analyzer.flight.verdict.case import FlightCase


def address_troubles(case: FlightCase) -> Iterator[Trouble]:
    """Yield two devices with one node ID, or one index."""
    told = [one for one in case.escs if one.ch is not None]
    by_index: dict[tuple[str, int, int], set[int]] = {}
    by_node: dict[tuple[str, int, int], set[int]] = {}
    for one in told:
        by_index.setdefault((one.table, one.bus, one.ch or 0), set()).add(one.node)
        by_node.setdefault((one.table, one.bus, one.node), set()).add(one.ch or 0)
    for (table, bus, ch), nodes in by_index.items():
        if len(nodes) > 1 and _at_once([one for one in told if (one.table, one.bus, one.ch) == (table, bus, ch)]):
            yield Trouble(
                "address", f"two ESCs have one index: nodes {' and '.join(map(str, sorted(nodes)))}", [],
                case.start, case.start, bus, max(nodes), ch, order=0,
                reasons=[f"both report as ch{ch}, all the time", *_nobody(case)],
            )  # fmt: skip
    for (table, bus, node), chs in by_node.items():
        mine = [one for one in told if (one.table, one.bus, one.node) == (table, bus, node)]
        counts = (case.losses.missing, case.losses.repeated)
        left_out, twice = (count(case.start, case.border, [(bus, node)]) for count in counts)
        if (
            len(chs) > 1
            and _at_once(mine)
            and left_out + twice > threshold("shared_percent") / 100 * sum(one.count for one in mine)
        ):
            yield Trouble(
                "address", f"two devices have node ID {node}", [], case.start, case.start, bus, node, None,
                tuple(sorted(chs)), order=0,
                reasons=[
                    f"it reports as {' and '.join(f'ch{ch}' for ch in sorted(chs))} at once",
                    f"its transfer IDs do not follow each other: {left_out} left out, {twice} twice",
                ],
            )  # fmt: skip


def _nobody(case: FlightCase) -> Iterator[str]:
    """Yield which channels nobody is."""
    chs = {one.ch for one in case.escs if one.ch is not None}
    lacking = sorted(set(case.flight.chs or chs) | set(range(1, len(case.esc_nodes) + 1)) - chs)
    missing = [ch for ch in lacking if ch not in chs]
    if missing:
        yield f"nobody is ch{', ch'.join(map(str, missing))}"


def _at_once(several: Sequence[EscExtent]) -> bool:
    """Return whether all of them reported in the same time."""
    first = max(one.first for one in several)
    last = min(one.last for one in several)
    return first < last
