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
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.window.listed import ListedRows
    from dissectors import Registry


class Writer(Protocol):
    """A view over a whole capture, as text with its line ends."""

    def begin(self) -> str:
        """Return what stands before everything."""

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Yield what each picked transfer of one batch says, then what stands behind them."""

    def end(self) -> str:
        """Return what stands after everything."""


@dataclass(frozen=True, slots=True)
class ViewFormat:
    """A view for programs: its name for `-T`, its module in `analyzer.views`, and its class there.

    `marks` says that the class takes which rules name which frames, too, `derives` that it gives derived values.
    """

    name: str
    module: str
    view: str
    marks: bool = False
    derives: bool = False

    def writer(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> Writer:
        """Return the view; its module is imported only now. Raises `ValueError` for what it cannot give."""
        if named is not None and not self.marks:
            raise ValueError(f"-T {self.name} does not mark rows with --findings")
        if derived and not self.derives:
            raise ValueError(f"-T {self.name} has no derived values")
        module: Any = import_module(f"analyzer.views.{self.module}")
        made: Writer = getattr(module, self.view)(
            registry, *(() if named is None else (named,)), **({"derived": True} if derived else {})
        )  # fmt: skip
        return made


FORMATS = (
    ViewFormat("json", "records", "JsonArray", marks=True, derives=True),
    ViewFormat("jsonl", "records", "JsonLines", marks=True, derives=True),
    ViewFormat("csv", "records", "Csv", marks=True, derives=True),
)
BY_NAME = {form.name: form for form in FORMATS}
