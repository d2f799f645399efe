"""The contents of a dissector's module: rules, exercises, labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from dissectors.kit.rule import Rule
    from dissectors.kit.view import View


class Exercise(Protocol):
    """Collects what a capture exercised, in the words that pages use for what a rule needs."""

    def feed(self, view: View) -> None:
        """Add the next batch."""

    def words(self) -> Iterable[str]:
        """Return what was there, such as `motors running`."""


@runtime_checkable
class Measures(Protocol):
    """Numbers that an `Exercise` may offer beside words.

    Names that vehicle files ask for: `escs` (how many), `running_s` (seconds with motors turning), `unit N` (node ID of
    power unit N, in decimal).
    """

    def facts(self) -> Mapping[str, float]:
        """Return numbers of the whole capture by name."""


@dataclass(frozen=True, slots=True)
class Conformance:
    """All that a dissector's module adds to its pages, as its attribute `CONFORMANCE`.

    `labels` names units as people call them from a node's tables: it is given the view and yields (bus, node, label).
    """

    rules: tuple[type[Rule], ...] = ()
    exercises: tuple[type[Exercise], ...] = ()
    labels: Callable[[View], Iterable[tuple[int, int, str]]] | None = None
