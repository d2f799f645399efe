"""The report as plain data: what the formats show, and nothing that they would have to compute.

`as_json` gives the documented JSON (schema.json); the names in both are the same. Frame numbers count from 1, times are
ns since 1970 (null where the capture has none), shares are 0 to 1. Every text that may come from a capture is raw: each
format escapes it in its own way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from analyzer.rules import verdicts
from dissectors.records import as_dict, dataclass, field

if TYPE_CHECKING:
    from analyzer.flight.verdict.model import Triage
    from analyzer.rules.verdicts import Excused

SCHEMA = "tailbyte.check/1"

Severity = Literal["error", "warning", "note"]
Category = Literal["protocol", "device", "capture"]
Origin = Literal["document", "implied", "dronecan", "heuristic", "vehicle"]
Verdict = verdicts.Verdict
Judgeable = Literal["yes", "no", "unknown", "coarse"]

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
CATEGORIES: tuple[Category, ...] = ("device", "protocol", "capture")
VERDICTS: tuple[Verdict, ...] = verdicts.RANKED
NOT_IN_JSON = ("triages", "marks")  # of a report


@dataclass(frozen=True, slots=True)
class Place:
    """A frame and its time; no frame for what has none, such as a silence."""

    frame: int | None
    t_ns: int | None


@dataclass(frozen=True, slots=True)
class Example:
    """One occurrence with its bytes: `lines` are the frames as `candump -l` writes them, `text` says what is wrong."""

    frame: int | None
    t_ns: int | None
    text: str
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MarkedPlace:
    """A frame that somebody has marked, and what they wrote."""

    capture: str
    place: Place
    text: str


@dataclass(frozen=True, slots=True)
class Waiver:
    """Somebody accepts this finding until a day (YYYY-MM-DD)."""

    reason: str
    owner: str
    expires: str


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule, broken by one node and type on one bus, in one run without a pause of 10 s.

    `label` is the ESC as people call it (`ch6`), `key` what else keeps findings apart, `cause` the diagnosis in a word,
    `baseline` how it compares with an older report: new, worse, known, or empty without one. `fails` says that this
    finding counts against the gate.
    """

    rule: str
    title: str
    severity: Severity
    category: Category
    origin: Origin
    clause: str
    capture: str
    bus: str
    node: int | None
    label: str
    type: str
    key: str
    count: int
    first: Place
    last: Place
    frames: tuple[int, ...]
    cause: str
    text: str
    examples: tuple[Example, ...] = ()
    waiver: Waiver | None = None
    baseline: Literal["", "new", "worse", "known"] = ""
    fails: bool = False

    @property
    def excused(self) -> Excused:
        """Why it does not count, if it does not."""
        return "waived" if self.waiver is not None else "known" if self.baseline == "known" else ""


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """Something that a device did and that breaks no rule, such as a power-off. Names are those of a `Finding`."""

    rule: str
    title: str
    category: Category
    capture: str
    bus: str
    node: int | None
    label: str
    type: str
    place: Place
    text: str


@dataclass(frozen=True, slots=True)
class WaiverUse:
    """A waiver of the vehicle file and what it did: an `expired` one excuses nothing, whatever it would have covered.

    `node` and `type` narrow it down; `findings` are those of this report that it covers.
    """

    rule: str
    node: int | None
    type: str
    reason: str
    owner: str
    expires: str
    expired: bool
    findings: int


@dataclass(frozen=True, slots=True)
class RuleVerdict:
    """The verdict on one rule; `reason` says why it is not simply passed or failed."""

    rule: str
    title: str
    severity: Severity
    category: Category
    origin: Origin
    clause: str
    verdict: Verdict
    findings: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class BusUse:
    """One interface: frames per second, and its course in steps of `step_ns` from `start_ns` on.

    `load` is the share of the bit rate in each step, `rates` the frames in it; `limits` are frames per second that the
    settings allow, by what they hold for ("motors turn").
    """

    name: str
    frames: int
    mean: float
    peak: int
    bit_rate: int | None
    start_ns: int | None = None
    step_ns: int = 1_000_000_000
    load: tuple[float, ...] = ()
    rates: tuple[int, ...] = ()
    limits: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class NodeUse:
    """One node and what it sent; `types` maps a type to its count, `bad` counts broken transfers.

    `rates` are its transfers in each step of its bus (`BusUse.start_ns` and `step_ns`).
    """

    bus: str
    node: int
    label: str
    name: str
    role: str
    software: str
    types: dict[str, int]
    hz: float | None
    bad: int
    first_ns: int | None
    last_ns: int | None
    rates: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class TriageSummary:
    """The first cause in the last flight of a capture, between `t_ns` and `t_end_ns`, and how well it is supported.

    `kind` is a page of `explain`; `none` is nothing wrong seen, `unknown` cannot tell. `end` is how that flight ended,
    `wrong` whether something wrong was seen in it, which is so of an unknown cause, too.
    """

    kind: str
    title: str
    support: str
    bus: str
    node: int | None
    ch: int | None
    t_ns: int | None
    t_end_ns: int | None
    frame: int | None
    flight: int
    flights: int
    end: str
    wrong: bool

    @property
    def told(self) -> bool:
        """True if it tells a cause."""
        return bool(self.support)

    @property
    def ending(self) -> str:
        """How the flight ended, in words: motors that stop are no landing where something was wrong."""
        return "motors stopped" if self.end == "landed" and self.wrong else self.end


@dataclass(frozen=True, slots=True)
class CaptureSummary:
    """One capture as it was read: the sum of its lines, what became of its frames, and what it can show at all.

    `can_judge` answers with a `Judgeable`, but for `stamps`: the kinds of time stamps, in words. Only `timing` can be
    coarse: no two times nearer than 10 ms, so they prove nothing to rules.
    `arguments` are options that read it the same way once more, for commands that show its evidence. `triage` is what
    happened, None without a flight.
    """

    id: str
    path: str
    sha256: str
    form: str
    start_ns: int | None
    end_ns: int | None
    frames: int
    transfers: int
    accounting: dict[str, int]
    verdicts: dict[str, int]
    can_judge: dict[str, Judgeable | str]
    dialects: dict[str, dict[str, str]]
    buses: tuple[BusUse, ...] = ()
    nodes: tuple[NodeUse, ...] = ()
    damage: str = ""
    arguments: tuple[str, ...] = ()
    triage: TriageSummary | None = None


@dataclass(frozen=True, slots=True)
class Coverage:
    """The part of all there is that the capture exercised, by name. `never` are clauses that no capture can show."""

    types: dict[str, int]
    packets: dict[str, int]
    values: dict[str, dict[str, int]]
    clauses: dict[str, Verdict]
    never: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Requirement:
    """Something that the gate demands of a capture.

    What is `expected` of the vehicle and not met fails like an error; what is required of the capture and not met
    leaves it unjudged.
    """

    what: str
    met: bool
    found: str
    expected: bool = False


@dataclass(frozen=True, slots=True)
class Gate:
    """The gate: findings at or above `fail_on`, demands, damage; `exit_status` as documented."""

    fail_on: tuple[str, ...]
    failed: bool
    judged: bool
    exit_status: int
    reason: str
    requirements: tuple[Requirement, ...] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that one run of `tailbyte check` has to say. Findings are sorted worst first, then by time.

    `events`, by time, are no findings: no count, no verdict and no gate knows of them.

    `triages` say what happened in each capture, if that was looked at; they have a JSON of their own. `marks` are what
    somebody has marked in them (`tailbyte view`).

    `settings` names the `profile` (empty for the defaults), in `limits` the numbers of each rule that has some, and in
    `changed` those (`RULE.name`) that are not the default; other options are shown as they are.
    """

    tool: str
    settings: dict[str, Any]
    captures: tuple[CaptureSummary, ...]
    findings: tuple[Finding, ...]
    rules: tuple[RuleVerdict, ...]
    coverage: Coverage
    gate: Gate
    waivers: tuple[WaiverUse, ...] = ()
    events: tuple[DeviceEvent, ...] = ()
    triages: tuple[Triage, ...] = ()
    marks: tuple[MarkedPlace, ...] = ()
    schema: str = field(default=SCHEMA)

    def as_json(self) -> dict[str, Any]:
        """Return plain dictionaries and lists, `schema` first."""
        alone = {name: getattr(self, name) for name in self.__match_args__ if name not in ("schema", *NOT_IN_JSON)}
        found: dict[str, Any] = {"schema": self.schema} | as_dict(alone)
        return found
