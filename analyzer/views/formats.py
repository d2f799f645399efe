"""The views for programs, `-T NAME`: a new one is a class in a file beside this one, and a line in `FORMATS`.

Such a class is made from the registry of types and writes a capture as text with its line ends: `begin()`, then
`rows(batch, picked)` for each batch, then `end()`.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array


class Writer(Protocol):
    """A view over a whole capture, as text with its line ends."""

    def begin(self) -> str:
        """Return what stands before everything."""

    def rows(self, batch: Batch, picked: Array) -> Iterator[str]:
        """Yield what the picked transfers of one batch say, then what stands behind them."""

    def end(self) -> str:
        """Return what stands after everything."""


@dataclass(frozen=True, slots=True)
class ViewFormat:
    """A view for programs: its name for `-T`, its module in `analyzer.views`, and its class there."""

    name: str
    module: str
    view: str

    def writer(self, registry: Registry) -> Writer:
        """Return the view; its module is imported only now."""
        module: Any = import_module(f"analyzer.views.{self.module}")
        made: Writer = getattr(module, self.view)(registry)
        return made


FORMATS = (
    ViewFormat("json", "records", "JsonArray"),
    ViewFormat("jsonl", "records", "JsonLines"),
    ViewFormat("csv", "records", "Csv"),
)
BY_NAME = {form.name: form for form in FORMATS}
