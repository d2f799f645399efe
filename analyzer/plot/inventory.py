"""The content of a recording, series by series: all that a layout needs to know of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator

Kind = Literal["line", "state", "points", "text"]
MOST_SERIES = 20_000


@dataclass(slots=True)
class Series:
    """One entity. `quantity` is the name of its plot, `unit` the device, `measure` the unit of its values.

    `number` orders devices and gives them their colours. `owner` says where it belongs: a device kind like `esc`,
    `node`, `bus` or `messages`. The lane of a `flag` is `active` once the
    flag was set; that of another state has the names in `states`, in the order of their codes.
    """

    path: str
    kind: Kind
    quantity: str
    title: str
    measure: str = ""
    role: str = ""
    unit: str = ""
    owner: str = ""
    number: int = 0
    flag: bool = False
    active: bool = True
    states: tuple[str, ...] = ()
    count: int = 0


@dataclass(slots=True)
class Inventory:
    """Series in the order of their appearance; at most `MOST_SERIES`, `beyond` counts what came after."""

    series: dict[str, Series] = field(default_factory=dict)
    beyond: int = 0

    def add(self, one: Series) -> bool:
        """Add a series; True if it is new, one too many is only counted."""
        if one.path in self.series:
            return False
        if len(self.series) >= MOST_SERIES:
            self.beyond += 1
            return False
        self.series[one.path] = one
        return True

    def of(self, quantity: str) -> Iterator[Series]:
        """Give the series of one plot."""
        return (one for one in self.series.values() if one.quantity == quantity)
