"""The differences between two captures as plain data: what the views show, and nothing that they would have to compute.

Times are ns since 1970 (null where a capture has none), frame numbers count from 1. Every text that may come from a
capture is raw: each view escapes it in its own way.
"""

from __future__ import annotations

from typing import Any, Literal

from analyzer.flight.verdict import model as verdicts
from dissectors.records import as_dict, dataclass, field

SCHEMA = "tailbyte.diff/1"

Kind = Literal[
    "flight",
    "node",
    "exchange",
    "firmware",
    "hardware",
    "reading",
    "parameter",
    "rate",
    "loss",
    "telemetry",
    "finding",
    "bus",
]
Weight = Literal["error", "warning", "note"]
Support = verdicts.Support  # a difference is supported as a verdict is

KINDS: tuple[Kind, ...] = (
    "flight", "exchange", "node", "hardware", "firmware", "reading", "parameter", "rate", "loss", "telemetry",
    "finding", "bus",
)  # fmt: skip
WEIGHTS: tuple[Weight, ...] = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two captures. `can_judge` says what it can show at all, as in a report of `check`.

    `lost` are transfers that are missing by their IDs, of all senders; `arguments` are options that read it once more.
    """

    path: str
    form: str
    sha256: str
    start_ns: int | None
    end_ns: int | None
    frames: int
    transfers: int
    lost: int
    buses: tuple[str, ...]
    nodes: int
    can_judge: dict[str, str]
    damage: str = ""
    arguments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that is not alike in both captures.

    `who` names the device as people do (`ch5`), `bus` and `node` are those of the second capture, or of the first where
    the second has none. `what` is compared, `good` and `bad` are its values in words, with `good_value` and `bad_value`
    as numbers in `unit` where they are such; `good_count` and `bad_count` tell how much each is drawn from. `size` is
    the difference in multiples of what counts as one. `t_ns` and `frame` are where it begins in the second capture,
    null for all of it. `since` says so in a word: `throughout`, `from`, `first`, or empty. `eased` is a note that was
    more than one in the first capture.
    """

    kind: Kind
    weight: Weight
    who: str
    bus: str
    node: int | None
    what: str
    good: str
    bad: str
    support: Support
    size: float = 1.0
    good_value: float | None = None
    bad_value: float | None = None
    unit: str = ""
    good_count: int = 0
    bad_count: int = 0
    since: Literal["", "throughout", "from", "first"] = ""
    t_ns: int | None = None
    frame: int | None = None
    rule: str = ""
    remark: str = ""
    command: str = ""
    eased: bool = False


@dataclass(frozen=True, slots=True)
class Compared:
    """Something that was compared, and how much of it there was in both."""

    what: str
    count: int
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Matched:
    """A node of the first capture and the one of the second that it was compared with."""

    bus: str
    node: int
    bad_bus: str
    bad_node: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class CaptureDiff:
    """Everything that one run of `tailbyte diff` has to say. Differences are sorted: the worst, then what began first.

    `compared` says what both captures have, `cannot` what could not be compared and why, `remarks` what is true of the
    pair and no difference. `failed` says that a difference is one that somebody asked to fail on.
    """

    tool: str
    good: Side
    bad: Side
    differences: tuple[Difference, ...]
    compared: tuple[Compared, ...]
    cannot: tuple[str, ...]
    remarks: tuple[str, ...]
    matched: tuple[Matched, ...]
    limits: dict[str, float]
    fail_on: tuple[str, ...] = ()
    failed: bool = False
    schema: str = field(default=SCHEMA)

    @property
    def judged(self) -> bool:
        """True if both hold anything to compare."""
        return bool(self.good.transfers and self.bad.transfers)

    @property
    def unopened(self) -> bool:
        """True if one of them could not be read at all."""
        return any(side.damage and not side.frames for side in (self.good, self.bad))

    def as_json(self) -> dict[str, Any]:
        """Return plain dictionaries and lists, `schema` first."""
        return {"schema": self.schema} | {name: value for name, value in as_dict(self).items() if name != "schema"}
