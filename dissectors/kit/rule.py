"""A rule at work."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, ClassVar, TypedDict, Unpack

if TYPE_CHECKING:
    from dissectors.kit.occurrence import Occurrence, Occurrences, Severity
    from dissectors.kit.view import View


class Rule:
    """Follows a capture for the rules that it names; one object a capture, so it may remember what it needs.

    What it finds must not depend on where batches end. Memory is bounded.
    """

    rules: ClassVar[tuple[str, ...]] = ()

    def feed(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Return the breaches that this batch shows."""
        return ()

    def finish(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Return the breaches that only the end of the capture shows; the view has no rows."""
        return ()


Feed = Callable[["View"], Iterable["Occurrences | Occurrence"]]


class PageKeys(TypedDict, total=False):
    """The page of a rule in place of a TOML file: the same keys with the same meaning, each written out."""

    title: str
    severity: Severity
    category: str
    origin: str
    clause: str
    dronecan: str
    enabled: bool
    checks: str
    matters: str
    example: str
    next: str
    text: str
    episode: str
    key: list[str]
    settings: dict[str, float]
    exercised: str
    inconclusive: list[str]
    judges: list[str]
    note: str
    also: list[str]
    explained: list[str]
    event: bool
    drops: bool
    fault: bool


def rule(*rules: str, **page: Unpack[PageKeys]) -> Callable[[Feed], type[Rule]]:
    """Make a function over one batch a `Rule` that remembers nothing.

    A small rule may have its page here; it is read from the code, see `dissectors.pages`.
    """
    if page and len(rules) != 1:
        raise TypeError("a page is that of one rule")

    def made(feed: Feed) -> type[Rule]:
        def see(_self: Rule, view: View) -> Iterator[Occurrences | Occurrence]:
            yield from feed(view)

        about = {"__module__": feed.__module__, "__doc__": feed.__doc__}
        return type(feed.__name__, (Rule,), {"rules": rules, "feed": see, **about})

    return made
