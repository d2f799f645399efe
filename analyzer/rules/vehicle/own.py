"""Rules of a vehicle file's own: read, checked, and given a page each, before a capture is opened.

[rule.ACME-001]
title = "An ESC gets too hot"
when = "ESCStatus.temperature_celsius > 100"   # a display filter
for = "2 s"                                    # must hold that long
[rule.ACME-002]                                # a demand
title = "The motor does not follow"
when = 'PUSHSCI.FocControl.mode == "speed"'
then = "within(PUSHCAN.MotorStatus.speed, PUSHSCI.FocControl.speed, 10 %)"
within = "500 ms"
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple, NoReturn, cast

from analyzer.filter.conditions import Conditions
from analyzer.filter.language.errors import FilterError, listed, near
from analyzer.filter.language.parser import parse
from analyzer.filter.names import FilterNames
from analyzer.rules.catalogue import LAYERS, OWN, Page
from dissectors.keys.pages import CATEGORIES, SEVERITIES
from dissectors.records import dataclass
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from collections.abc import Set as AbstractSet

    from analyzer.filter.conditions import AskedWord
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.nodes import Condition, LagNode
    from dissectors import Registry
    from dissectors.kit import Severity
    from dissectors.toml_table import TomlTable

MOST_RULES = 256
LONGEST = 600 * SECOND
_NEVER = ("err", "rtr")  # flags that no frame of a transfer has
_BY_ID = ("src", "dst")  # columns of transfers that the identifier of a frame tells, too
_NAME = re.compile(r"[A-Z]{1,16}-[0-9]{1,6}", re.ASCII)
_DURATION = re.compile(r"(\d{1,12})(?:\.(\d{1,9}))?\s*([a-z]*)", re.ASCII)
_UNITS = {"us": MILLISECOND // 1000, "ms": MILLISECOND, "s": SECOND, "min": 60 * SECOND}
_PLACES = re.compile(r"\{([^{}]*)\}")
_BRACE = re.compile(r"[{}]")
_KEYS = (
    "title", "when", "for", "then", "within", "severity", "category", "text", "checks", "matters", "example", "next",
    "enabled",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Clause:
    """A filter of a rule: `tables` are those of the types and packets of which it looks at each row, in order.

    Without any it looks at every transfer, or, if it names fields of `frames` alone, at every frame; at error frames
    only if it asks for `errors`. `fields` are all that it names, in the order of naming.
    """

    text: str
    condition: Condition
    lags: tuple[LagNode, ...]
    fields: tuple[FieldRef, ...]
    tables: tuple[str, ...]
    frames: bool = False
    errors: bool = False


@dataclass(frozen=True, slots=True)
class OwnRule:
    """A rule of a vehicle file. `text` is cut into words and fields; times are in ns, 0 for none."""

    rule: str
    page: Page
    when: Clause
    then: Clause | None
    lasts: int
    within: int
    text: tuple[str | FieldRef, ...]

    @property
    def told_fields(self) -> tuple[FieldRef, ...]:
        """The fields of `when` and of the text."""
        return (*self.when.fields, *(part for part in self.text if not isinstance(part, str)))


@dataclass(frozen=True, slots=True)
class OwnRules:
    """All rules of a vehicle file, with what it calls its nodes."""

    rules: tuple[OwnRule, ...] = ()
    labels: Mapping[int, str] | None = None

    @property
    def pages(self) -> dict[str, Page]:
        """Their pages."""
        return {one.rule: one.page for one in self.rules}


class _FileNames(NamedTuple):
    """The meaning of names in the filters of a file: fields, and labels of nodes."""

    fields: FilterNames
    labels: AbstractSet[str]

    def check_labels(self, text: str, words: Iterable[AskedWord]) -> None:
        """Raise `FilterError` for a label that the filter `text` asks for and no node has."""
        for word in words:
            if word.field == "node.label" and word.text not in self.labels:
                meant = near(word.text, sorted(self.labels))
                hint = f"; did you mean {listed(meant)}?" if meant else ""
                raise FilterError(f"no node in this file is called {word.text!r:.60}{hint}", text, *word.span, meant)


def read_own(
    table: TomlTable, pages: Mapping[str, Page], registry: Registry, keys: AbstractSet[str], labels: AbstractSet[str]
) -> tuple[OwnRule, ...]:
    """Read the rules of the table `rule` that have no page yet, or that have `keys` of own ones.

    `labels` are those of the nodes in the file.

    Raises `ProfileError`, for filters with a caret.
    """
    own = [name for name, body in table.body.items() if name not in pages or not keys.isdisjoint(body)]
    if len(own) > MOST_RULES:
        table.fail(f"{len(own)} rules of its own, more than {MOST_RULES}", own[MOST_RULES])
    names = _FileNames(FilterNames(registry), labels)
    return tuple(_read(table, name, pages, names, registry) for name in own)


def _read(outer: TomlTable, name: str, pages: Mapping[str, Page], names: _FileNames, registry: Registry) -> OwnRule:
    if name in pages:
        outer.fail(f"{name} is built in: choose another name for a rule of your own, such as ACME-001", name)
    body = outer.table(name)
    if "when" not in body.body:
        if slip := next((key for key in body.body if near(key, ["when"]) and key not in _KEYS), ""):
            body.fail("unknown key; did you mean when?", slip)
        known = near(name, list(pages))
        hint = f"near: {', '.join(known)}; " if known else ""
        outer.fail(f"no rule is called {name!r:.60} ({hint}one of your own needs `when`)", name)
    if not _NAME.fullmatch(name):
        outer.fail(f"{name!r:.60} is no name of a rule: LETTERS-NUMBER, such as ACME-001", name)
    if name.partition("-")[0] in LAYERS:
        outer.fail(f"rules of {name.partition('-')[0]} are built in: choose other letters, such as ACME-001", name)
    for key in body.body:
        if key not in _KEYS:
            meant = near(key, list(_KEYS))
            body.fail(f"unknown key{'; did you mean ' + ' or '.join(meant) + '?' if meant else ''}"
                      f" (allowed: {', '.join(sorted(_KEYS))})", key)  # fmt: skip
    when = _clause(body, "when", names, ())
    if ("then" in body.body) != ("within" in body.body):
        missing = "within" if "then" in body.body else "then"
        body.fail(f"{missing} is missing: a demand says what must follow, and within what time")
    then = _clause(body, "then", names, when.tables) if "then" in body.body else None
    if then is not None:
        _refuse_frames(body, when=when, then=then)
    lasts, within = _duration(body, "for"), _duration(body, "within")
    text = _words(body, names.fields, frames=when.frames)
    page = _page(name, body, when, then, registry)
    body.finish()
    return OwnRule(name, page, when, then, lasts, within, text)


def _clause(body: TomlTable, key: str, names: _FileNames, others: tuple[str, ...]) -> Clause:
    """Return a filter. Its rows are those of the type that it names first, and that no other clause looks at."""
    text = body.string(key, required=True)
    try:
        made = Conditions(text, names.fields, across=True)
        condition = made.make(parse(text))
        names.check_labels(text, made.words)
        named = {ref.key: ref for ref in condition.fields()}
        fields = sorted(named.values(), key=lambda ref: text.find(ref.name))
    except FilterError as error:
        _fail(body, key, error)
    except RecursionError:
        body.fail("nested too deeply", key)
    if asking := next((ref.name for ref in fields if ref.origin == "finding"), ""):
        at = max(text.find(asking), 0)
        _fail(body, key, FilterError("a rule cannot ask what rules find", text, at, at + len(asking)))
    frames = any(ref.origin == "frame" for ref in fields) and all(map(_of_frame, fields))
    flags = [ref for ref in fields if ref.origin == "frame" and ref.column in _NEVER]
    if flags and not frames:
        at = max(text.find(flags[0].name), 0)
        reason = "no transfer has an error frame or remote frame: a rule on them names fields of frames alone"
        _fail(body, key, FilterError(reason, text, at, at + len(flags[0].name)))
    typed = [ref.tables for ref in fields if ref.origin in ("table", "type")]
    chosen = [tables for tables in typed if not set(tables) & set(others)] or typed
    broken = any(ref.origin == "transfer" and ref.column == "status" for ref in fields)
    return Clause(text, condition, tuple(made.operands.lags), tuple(fields), chosen[0] if chosen and not broken else (),
                  frames, any(ref.column == "err" for ref in flags))  # fmt: skip


def _of_frame(ref: FieldRef) -> bool:
    """Return whether a frame has a field, a transfer or none."""
    return ref.origin in ("frame", "node", "label") or (ref.origin == "transfer" and ref.column in _BY_ID)


def _refuse_frames(body: TomlTable, **clauses: Clause) -> None:
    """Refuse demands of frames."""
    for key, clause in clauses.items():
        if clause.frames:
            text = clause.text
            name = next(ref.name for ref in clause.fields if ref.origin == "frame")
            at = max(text.find(name), 0)
            reason = "a demand is of transfers, this names frames alone: add a type, such as NodeStatus &&"
            _fail(body, key, FilterError(reason, text, at, at + len(name)))


def _fail(body: TomlTable, key: str, error: FilterError) -> NoReturn:
    body.fail_inside(error.reason, key, error.text[: error.start], error.place)


def _duration(body: TomlTable, key: str) -> int:
    if key not in body.body:
        return 0
    value = body.body[key]
    if not isinstance(value, str):
        body.fail(f'a time with its unit in quotes is expected, such as "2 s", not {value!r:.40}', key)
    text = body.string(key)
    found = _DURATION.fullmatch(text.strip())
    if found is None:
        _fail(body, key, FilterError('no time: write "2 s", "500 ms" or "1 min"', text, 0, len(text)))
    whole, part, unit = found[1], found[2] or "", found[3]
    if unit not in _UNITS:
        at = text.rfind(unit) if unit else len(text)
        reason = f"unknown unit of time {unit!r}" if unit else "a unit is missing"
        _fail(body, key, FilterError(f"{reason}: one of {', '.join(_UNITS)}", text, at, at + max(len(unit), 1)))
    ns = int(whole + part) * _UNITS[unit] // int(10 ** len(part))
    if not 0 < ns <= LONGEST:
        _fail(body, key, FilterError(f"a time above 0, up to {LONGEST // SECOND} s", text, 0, len(text)))
    return ns


def _words(body: TomlTable, names: FilterNames, *, frames: bool) -> tuple[str | FieldRef, ...]:
    """Return the text of findings in parts: words, and fields in braces."""
    text = body.string("text")
    found: list[str | FieldRef] = []
    end = 0
    for place in _PLACES.finditer(text):
        found.append(text[end : place.start()])
        if "[" in place[1]:
            whole = place[1].partition("[")[0].strip()
            _fail(body, "text", FilterError(f"a text shows whole fields: write {{{whole}}}", text, *place.span(1)))
        try:
            ref = names.find(place[1].strip(), text, place.start(1) + len(place[1]) - len(place[1].lstrip()))
        except FilterError as error:
            _fail(body, "text", error)
        if ref.origin not in ("table", "transfer", "frame", "node"):
            _fail(body, "text", FilterError("a text shows fields of rows only", text, place.start(1), place.end(1)))
        if frames and not _of_frame(ref):
            reason = "the rule looks at frames: its text shows fields of frames, such as {can.id}"
            _fail(body, "text", FilterError(reason, text, place.start(1), place.end(1)))
        found.append(ref)
        end = place.end()
    if lone := _BRACE.search(_PLACES.sub(lambda place: " " * len(place[0]), text)):
        reason = f"a {lone[0]} without its other half: a field stands in both, such as {{dronecan.src}}"
        _fail(body, "text", FilterError(reason, text, *lone.span()))
    return (*found, text[end:]) if text else ()


def _page(rule: str, body: TomlTable, when: Clause, then: Clause | None, registry: Registry) -> Page:
    title = body.string("title", required=True)
    severity = cast("Severity", body.one_of("severity", SEVERITIES) or "warning")
    category = body.one_of("category", CATEGORIES) or "device"
    lasts, within = body.string("for"), body.string("within")
    checks = _line(when.text) + (f", for {lasts}" if lasts else "")
    checks += f"; then {_line(then.text)}, within {within}" if then is not None else ""
    times = ("times",) if lasts or then is not None or when.lags else ()
    rows = "frames" if when.frames else "transfers"
    exercised = f"demand:{rule}" if then is not None else "|".join(_seen(when.tables, registry)) or rows
    flag = body.flag("enabled")
    enabled = flag or "enabled" not in body.body
    shown = {
        "title": title, "severity": severity, "category": category, "origin": OWN, "clause": "-",
        "checks": body.string("checks") or checks, "matters": body.string("matters") or "The vehicle file asks for it.",
        "example": body.string("example") or "-", "next": body.string("next") or "-", "exercised": exercised,
        "inconclusive": list(times), "enabled": enabled,
    }  # fmt: skip
    return Page(
        rule=rule, title=title, severity=severity, category=category, origin=OWN, clause="-", enabled=enabled,
        text="{said}", values=("said", "of"), key=("of",), settings={}, exercised=exercised, inconclusive=times,
        tests=(), body=shown, drops=then is not None,
    )  # fmt: skip


def _line(text: str) -> str:
    """Return a filter as one line."""
    return " ".join(text.split())


def _seen(tables: tuple[str, ...], registry: Registry) -> list[str]:
    """Return the words of `exercise` for the types of tables."""
    return list(dict.fromkeys(
        f"type:{name}" if registry.message_of(name) is not None else f"packet:{name.rpartition('.')[2]}"
        for name in tables
    ))  # fmt: skip
