"""Frames that the recorder lost without saying so."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from dissectors.kit import Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View


class Inferred(Rule):
    """CAP-006: several senders lack frames at the same time."""

    rules: ClassVar[tuple[str, ...]] = ("CAP-006",)

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield the places that are settled with this batch."""
        return _places(view)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield the rest."""
        return _places(view)


def _places(view: View) -> Iterator[Occurrence]:
    for one in view.joint_losses:
        values = {"senders": one.senders}
        yield Occurrence("CAP-006", one.since, one.bus, None, "", one.frames, values)
