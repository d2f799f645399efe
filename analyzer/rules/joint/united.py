"""Occurrences of one rule that were found piece by piece, as one: what is done once for each takes as long for many."""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import Occurrences
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator, Sequence

    from dissectors.kit import Array, Occurrence, Values


def united(found: Iterable[Occurrences | Occurrence], keyed: Container[str]) -> Iterator[Occurrences | Occurrence]:
    """Yield the same occurrences; those that are alike but for their rows come together, where the first one was.

    Rules that are `keyed` tell by their values which findings they belong to: these stay as they are.
    """
    alike: dict[Any, list[Occurrences]] = {}
    order: list[Occurrence | list[Occurrences]] = []
    for one in found:
        if not isinstance(one, Occurrences):
            order.append(one)
        elif one.key is not None or one.rule in keyed:
            order.append([one])
        elif len(one.t):
            missing = one.since is None, one.until is None, one.rises is None, one.lines is None
            kinds = (*((name, kind) for name, (kind, _) in one.worst.items()),)
            what = one.rule, one.severity, (*one.dialects.items(),), one.drops, missing, kinds
            if what not in alike:
                order.append(alike.setdefault(what, []))
            alike[what].append(one)
    for some in order:
        if isinstance(some, list):
            yield some[0] if len(some) == 1 else _joined(some)
        else:
            yield some


def _joined(parts: Sequence[Occurrences]) -> Occurrences:
    first = parts[0]
    begins = [0, *accumulate(len(one.t) for one in parts)]
    which = np.repeat(np.arange(len(parts)), np.diff(begins))

    def column(name: str) -> Array:
        return np.concatenate([getattr(one, name) for one in parts])

    def optional(name: str) -> Array | None:
        return None if getattr(first, name) is None else column(name)

    def values(k: int) -> Values:
        at = which.item(k)
        return parts[at].values(k - begins[at])

    def frames(k: int) -> Sequence[int]:
        at = which.item(k)
        return parts[at].frames(k - begins[at])

    def lines(k: int) -> tuple[str, ...]:
        at = which.item(k)
        kept = parts[at].lines
        return kept(k - begins[at]) if kept is not None else ()

    doubtful = None
    if any(one.doubtful is not None for one in parts):
        none = (np.zeros(len(one.t), bool) for one in parts)
        masks = [no if one.doubtful is None else one.doubtful for one, no in zip(parts, none, strict=True)]
        doubtful = np.concatenate(masks)
    return replace(
        first, t=column("t"), bus=column("bus"), node=column("node"), type=column("type"), frame=column("frame"),
        values=values, frames=frames, since=optional("since"), until=optional("until"), rises=optional("rises"),
        doubtful=doubtful, lines=None if first.lines is None else lines,
        worst={
            name: (kind, np.concatenate([one.worst[name][1] for one in parts]))
            for name, (kind, _) in first.worst.items()
        },
    )  # fmt: skip
