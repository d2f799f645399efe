"""Breaches of rules: one, or many of the same kind in arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from dissectors.records import dataclass, field
from dissectors.schema import BYTE_ORDERS

if TYPE_CHECKING:
    from dissectors.kit.array import Array

Values = Mapping[str, Any]
Severity = Literal["error", "warning", "note"]
# By size, whatever the sign: the last two; of a number, what is farthest from it.
Worst = Literal["lowest", "highest", "slowest", "strongest"] | float

# The reading of nodes whose packets show nothing as long as they are read in the other byte order.
TURNED: Mapping[str, Severity | None] = {BYTE_ORDERS[1]: None}


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One breach of a rule. `frames` are its evidence, the first one is its place; none for a silence.

    `type` is the name of a table. `values` fill the text of the rule's page and make up its key. `severity` stands
    instead of the page's. `dialects` maps the reading that the node turns out to use to another severity, or to None
    if it is no breach then. `drops` makes it a note close to frames that the recorder lost; it is looked for them from
    `since` to `until`, if these are not `t`. `lines` are the evidence as `View.lines` gave it, for a rule that holds an
    occurrence back.
    """

    rule: str
    t: int
    bus: int
    node: int | None
    type: str
    frames: Sequence[int]
    values: Values
    severity: Severity | None = None
    dialects: Mapping[str, Severity | None] = field(default_factory=dict)
    drops: bool = False
    since: int | None = None
    until: int | None = None
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Occurrences:
    """Many breaches of one rule, a row each; what is equal for all is said once, as with `Occurrence`.

    `t`, `bus`, `node` (-1 for none), `frame` (-1 for none) and `type` (codes of `View.type_name`) are arrays of equal
    length. `key` tells rows apart whose values may give different keys. `values` and `frames` are asked for the few
    rows that are shown. `key_values` gives only those values of a row that the rule's key is made of, where all take
    longer; they are the same for the same `key` in every batch if that `lasts`.

    `worst` maps names to which of a row's numbers is worst, and these: then a run of breaches is told as an episode,
    whose text may name `worst_NAME` beside the values at its onset, and how long it `lasted`. `rises` marks rows that a
    sender's report without the breach went before. `doubtful` marks rows that show nothing if their node is
    `TURNED`, as turns out. `each_named` says that lists mark all frames of a row, not its first one alone. `lines` are
    asked like `frames`, of a rule that holds rows back: evidence as `View.lines` gave it when it was still there.
    """

    rule: str
    t: Array
    bus: Array
    node: Array
    type: Array
    frame: Array
    values: Callable[[int], Values]
    frames: Callable[[int], Sequence[int]]
    key: Array | None = None
    key_values: Callable[[int], Values] | None = None
    lasts: bool = False
    severity: Severity | None = None
    dialects: Mapping[str, Severity | None] = field(default_factory=dict)
    drops: bool = False
    since: Array | None = None
    until: Array | None = None
    worst: Mapping[str, tuple[Worst, Array]] = field(default_factory=dict)
    rises: Array | None = None
    doubtful: Array | None = None
    each_named: bool = False
    lines: Callable[[int], tuple[str, ...]] | None = None
