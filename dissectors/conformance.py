"""The old name of `dissectors.kit`, for rules that were written before it; every name warns that it is going."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from dissectors import kit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

_NAMES = {
    "Events": "EventTable", "Found": "Occurrences", "Frames": "FrameTable", "Look": "Feed", "Table": "DecodedTable",
    "Transfers": "TransferTable", "Words": "Array",
}  # fmt: skip


class _Watcher(kit.Rule):
    """A rule with the methods of before: `look` is fed, `settle` finishes."""

    def look(self, _view: kit.View) -> Iterable[kit.Occurrences | kit.Occurrence]:
        """Return the breaches that this batch shows."""
        return ()

    def settle(self, _view: kit.View) -> Iterable[kit.Occurrences | kit.Occurrence]:
        """Return the breaches that only the end of the capture shows."""
        return ()

    def feed(self, view: kit.View) -> Iterable[kit.Occurrences | kit.Occurrence]:
        """Look."""
        return self.look(view)

    def finish(self, view: kit.View) -> Iterable[kit.Occurrences | kit.Occurrence]:
        """Settle."""
        return self.settle(view)


def _conformance(
    watchers: tuple[type[kit.Rule], ...] = (),
    exercises: tuple[type[Any], ...] = (),
    labels: Callable[[kit.View], Iterable[tuple[int, int, str]]] | None = None,
) -> kit.Conformance:
    """Return a `Conformance` whose exercises may still have `look`."""
    for one in exercises:
        if not hasattr(one, "feed"):
            one.feed = one.look
    return kit.Conformance(watchers, exercises, labels)


_CHANGED = {"Conformance": _conformance, "Watcher": _Watcher, "watches": kit.rule}


def __getattr__(name: str) -> Any:
    """Return what a name has become."""
    new = _NAMES.get(name, name)
    if name not in _CHANGED and new not in kit.__all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    became = {"Watcher": "Rule", "watches": "rule"}.get(name, new)
    warnings.warn(f"dissectors.conformance.{name} is now dissectors.kit.{became}", DeprecationWarning, stacklevel=2)
    return _CHANGED[name] if name in _CHANGED else getattr(kit, new)
