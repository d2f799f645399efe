"""Breaches that are found one by one and told together: nothing is looked up but for those that are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import NOBODY
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dissectors.kit import Severity, Values


class Sent(NamedTuple):
    """When something was sent, on which bus, by whom (None for nobody), and the code of its type (`NOBODY`: none)."""

    t: int
    bus: int
    node: int | None = None
    code: int = NOBODY


class _Breach(NamedTuple):
    sent: Sent
    frames: Sequence[int]
    values: Values | Callable[[], Values]
    key: str


class Gathered:
    """Collects breaches by rule and severity."""

    def __init__(self) -> None:
        self._parts: dict[tuple[str, Severity | None, bool], list[_Breach]] = {}

    def add(
        self, rule: str, sent: Sent, frames: Sequence[int], values: Values | Callable[[], Values],
        key: str = "",
        *, severity: Severity | None = None, drops: bool = True,
    ) -> None:  # fmt: skip
        """Add one; `values` may be what makes them, which is asked when it is shown.

        `key` is the same for those whose values have the same key, `drops` as with `Occurrence`.
        """
        self._parts.setdefault((rule, severity, drops), []).append(_Breach(sent, frames, values, key))

    def occurrences(self) -> Iterator[Occurrences]:
        """Yield all of them; then there are none."""
        parts, self._parts = self._parts, {}
        for (rule, severity, drops), found in parts.items():
            yield _joined(found, rule, severity, drops=drops)


def _joined(found: Sequence[_Breach], rule: str, severity: Severity | None, *, drops: bool) -> Occurrences:
    rows = [(sent.t, sent.bus, NOBODY if sent.node is None else sent.node, sent.code, frames[0])
            for sent, frames, _, _ in found]  # fmt: skip
    t, bus, node, code, frame = np.array(rows, np.int64).T
    ids: dict[str, int] = {}
    key = np.array([ids.setdefault(one.key, len(ids)) for one in found], np.int64)

    def values(k: int) -> Values:
        given = found[k].values
        return given() if callable(given) else given

    return Occurrences(
        rule=rule, t=t, bus=bus, node=node, type=code, frame=frame, values=values,
        frames=lambda k: found[k].frames, key=key, severity=severity, drops=drops, each_named=True,
    )  # fmt: skip
