"""The picture of a dissector's tables: which column is the voltage of which device, read from `plots.toml`.

A dissector's folder may hold that file; a table that no file speaks of is shown field by field. Columns are those of
the decoded tables, fields, parts (`field.part`) and derived ones alike.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from dissectors.keys import PLOTS
from dissectors.only import only
from dissectors.records import dataclass, field
from dissectors.registry import UnknownNameError
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.only import Only
    from dissectors.registry import Registry
    from dissectors.toml_table import TomlTable

FILE = "plots.toml"
SIGNS = ("motor", "heat", "supply", "current", "uncommanded", "electronics", "failed")


@dataclass(frozen=True, slots=True)
class Quantity:
    """Something that is measured or commanded: one plot, with a line for each device.

    A `detail` is nothing to compare devices by, and only shown with each of them.
    """

    name: str
    title: str
    unit: str = ""
    detail: bool = False


@dataclass(frozen=True, slots=True)
class Who:
    """Whose values a row holds.

    A device numbered by `column`; with `elements` the places in a list, each of them a device; with neither the node
    that sends. The device of number 0 is called `first`.
    """

    path: str = "node"
    title: str = "node"
    column: str = ""
    elements: bool = False
    first: int = 0


@dataclass(frozen=True, slots=True)
class Line:
    """The column of a quantity; `role` tells apart what shares its plot, such as commanded and reported."""

    quantity: str
    column: str
    role: str = ""
    only: Only | None = None


@dataclass(frozen=True, slots=True)
class States:
    """A column with named values, or a word whose flags and enumerations are lanes of their own.

    `signs` say of which trouble a flag is a sign, or a value (`name=value`): one of `SIGNS`.
    """

    column: str
    only: Only | None = None
    signs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Product:
    """A quantity that is the product of two others of the same row."""

    quantity: str
    factors: tuple[str, str]


@dataclass(frozen=True, slots=True)
class Integral:
    """A quantity that adds up another one over seconds, times `scale`."""

    quantity: str
    of: str
    scale: float


@dataclass(frozen=True, slots=True)
class Interval:
    """A quantity that is the time between a sender's rows in ms, or, with `change`, how much that time changed."""

    quantity: str
    change: bool = False


@dataclass(frozen=True, slots=True)
class EscColumns:
    """The columns of a table that go into the table `esc`, empty for none; commands have only `commanded`.

    `faults` is a word with flags, `mode` a column with named values, the others are numbers in the units of that table.
    """

    commanded: str = ""
    reported: str = ""
    rpm: str = ""
    voltage: str = ""
    current: str = ""
    temperature: str = ""
    mode: str = ""
    faults: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """The picture of one table. Columns in `hidden` say nothing that is not shown otherwise.

    Tables of `parameters` are shown beside the commands; of their columns those in `own` are of one device and no
    settings, `turning` are those that say which way a motor turns and what it follows, and `identity` tells one piece
    of hardware from all others; what sets them says in `saved` whether that
    is kept. `starts` counts how often a device was powered up. `esc_of` numbers, from 0, the ESC that a row is about
    where `who` is not that ESC. A motor faster than `idle_rpm` is driven; 0 if
    the vendor says nothing.
    """

    table: str
    who: Who = Who()
    lines: tuple[Line, ...] = ()
    states: tuple[States, ...] = ()
    products: tuple[Product, ...] = ()
    integrals: tuple[Integral, ...] = ()
    intervals: tuple[Interval, ...] = ()
    hidden: frozenset[str] = frozenset()
    parameters: bool = False
    own: frozenset[str] = frozenset()
    identity: str = ""
    turning: tuple[str, ...] = ()
    saved: str = ""
    starts: str = ""
    esc: EscColumns = EscColumns()
    esc_of: str = ""
    idle_rpm: int = 0


@dataclass(frozen=True, slots=True)
class Pictures:
    """The quantities of all folders in the order of their plots, and what is shown of each table."""

    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    plots: Mapping[str, Plot] = field(default_factory=dict)


_LOADED: WeakKeyDictionary[Registry, Pictures] = WeakKeyDictionary()


def load(registry: Registry) -> Pictures:
    """Return what the folders say; of two that speak of the same the first one counts. Raises `ProfileError`.

    Tables are named as people name messages; a packet stands behind the message that carries it. The files
    are read once.
    """
    known = _LOADED.get(registry)
    if known is None:
        known = _LOADED[registry] = _load(registry)
    return known


def _load(registry: Registry) -> Pictures:
    quantities: dict[str, Quantity] = {}
    plots: dict[str, Plot] = {}
    for profile in registry.profiles:
        path = profile.folder / FILE
        if not path.exists():
            continue
        top = read(path, PLOTS)
        own = {name: _quantity(name, table) for name, table in top.tables("quantity")}
        quantities = quantities | {name: found for name, found in own.items() if name not in quantities}
        for name, table in top.tables("table"):
            plots.setdefault(whole := _table(registry, name, table), _Reader(quantities).plot(whole, table))
        top.finish()
    return Pictures(quantities, plots)


def _table(registry: Registry, name: str, table: TomlTable) -> str:
    """Return the table that is meant."""
    message, _, packet = name.rpartition(".")
    try:
        if registry.named(message) and not registry.named(name):
            return f"{registry.table(message)}.{packet}"
        return registry.table(name)
    except UnknownNameError as error:
        table.fail(str(error))


def _quantity(name: str, table: TomlTable) -> Quantity:
    found = Quantity(name, table.string("title"), table.string("unit"), table.flag("detail"))
    table.finish()
    return found


class _Reader:
    """Reads what is shown of tables, in terms of the quantities there are."""

    def __init__(self, quantities: Mapping[str, Quantity]) -> None:
        self._quantities = quantities

    def plot(self, name: str, table: TomlTable) -> Plot:
        plot = Plot(
            table=name,
            who=_who(table.table("who")),
            lines=tuple(self._line(*one) for one in table.tables("line")),
            states=tuple(_states(*one) for one in table.tables("states")),
            products=tuple(self._product(*one) for one in table.tables("product")),
            integrals=tuple(self._integral(*one) for one in table.tables("integral")),
            intervals=tuple(self._interval(*one) for one in table.tables("interval")),
            hidden=frozenset(table.strings("hidden")),
            parameters=table.flag("parameters"),
            own=frozenset(table.strings("own")),
            identity=table.string("identity"),
            turning=tuple(table.strings("turning")),
            saved=table.string("saved"),
            starts=table.string("starts"),
            esc=_esc(table),
            esc_of=table.string("esc_of"),
            idle_rpm=table.integer("idle_rpm") or 0,
        )
        lines = {line.quantity for line in plot.lines}
        made = lines | {product.quantity for product in plot.products}
        for key, needed, known in (
            ("product", [factor for product in plot.products for factor in product.factors], lines),
            ("integral", [integral.of for integral in plot.integrals], made),
        ):
            for missing in needed:
                if missing not in known:
                    table.fail(f"no line is called {missing!r}", key)
        table.finish()
        return plot

    def _known(self, body: TomlTable, text: str, key: str = "") -> str:
        if text not in self._quantities:
            body.fail(f"{text!r} is no quantity (known: {', '.join(sorted(self._quantities))})", key)
        return text

    def _line(self, key: str, body: TomlTable) -> Line:
        quantity, _, role = key.partition("/")
        found = Line(self._known(body, quantity), body.string("column"), role, only(body))
        body.finish()
        return found

    def _product(self, key: str, body: TomlTable) -> Product:
        factors = body.strings("of")
        if len(factors) != 2:
            body.fail("two quantities are expected", "of")
        first, second = (self._known(body, factor, "of") for factor in factors)
        body.finish()
        return Product(self._known(body, key), (first, second))

    def _integral(self, key: str, body: TomlTable) -> Integral:
        of = self._known(body, body.string("of"), "of")
        found = Integral(self._known(body, key), of, float(body.scale("scale") or 1))
        body.finish()
        return found

    def _interval(self, key: str, body: TomlTable) -> Interval:
        found = Interval(self._known(body, key), change=body.flag("change"))
        body.finish()
        return found


def _states(key: str, body: TomlTable) -> States:
    signs = {name: sign for sign in SIGNS for name in body.strings(sign)}
    found = States(key, only(body), signs)
    body.finish()
    return found


def _who(table: TomlTable) -> Who:
    found = Who(
        path=table.string("path") or "node",
        title=table.string("title") or table.string("path") or "node",
        column=table.string("column"),
        elements=table.flag("elements"),
        first=table.integer("first") or 0,
    )
    if found.column and found.elements:
        table.fail("a device is numbered by a column or by its place in a list, not by both", "elements")
    table.finish()
    return found


def _esc(table: TomlTable) -> EscColumns:
    about = table.table("esc")
    found = EscColumns(**{column.name: about.string(column.name) for column in fields(EscColumns)})
    about.finish()
    return found
