"""The judge of `triage_campaign.py --judge bench.triage_judge:judge`: what `tailbyte triage` says first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.triage import triage

if TYPE_CHECKING:
    from pathlib import Path


def judge(path: Path) -> tuple[str, list[int], list[int], int | None, int | None]:
    """Kind, nodes, channels, and between which reports it began."""
    one = triage(path).first
    nodes = [] if one.node is None else [one.node]
    channels = [one.ch] if one.ch is not None else list(one.chs)
    return one.kind, nodes, channels, one.t, one.t_end
