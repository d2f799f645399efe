"""Happenings that an autopilot's log tells of: messages, errors, events, modes, arming, low batteries."""

from __future__ import annotations

import tomllib
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.sources.dataflash import AutopilotLog, LogTable

FILE = Path(__file__).with_name("words.toml")
# Names of the records that are read: what it says, and by what it is found on the bus.
SAID = ("MSG", "ERR", "EV", "MODE", "ARM", "BAT", "CURR", "ESC", "PARM")
_TEXTS = ("Message", "Name")
_ARMED, _DISARMED = 10, 11  # events that an ARM record tells better
# Parameters of a battery by the name of what it is below.
_LIMITS = {"low": "LOW_VOLT", "critical": "CRT_VOLT"}
_LOW_TIMER, _USUAL_TIMER = "LOW_TIMER", 10.0  # seconds; ArduPilot's own default


@dataclass(frozen=True, slots=True)
class Word:
    """Something that the autopilot says; `micros` is by its clock, `number` that of the record, `type` its name."""

    micros: int
    number: int
    kind: str
    type: str
    text: str
    values: Mapping[str, float] = field(default_factory=dict)
    until: int | None = None


def words(log: AutopilotLog) -> list[Word]:
    """Return what a log says, in its order."""
    parts = _messages(log), _modes(log), _armings(log), _events(log), _errors(log), _batteries(log)
    return sorted((word for part in parts for word in part), key=lambda word: (word.micros, word.number))


@cache
def _facts() -> Mapping[str, Any]:
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


def _rows(table: LogTable, *names: str) -> Iterator[tuple[int, int, list[Any]]]:
    """Yield time, number and fields of records, of fields that a table does not have 0.

    Nothing if one is not of its kind, text or number.
    """
    if any(name in table.columns and (table.columns[name].dtype.kind == "O") != (name in _TEXTS) for name in names):
        return
    columns = [table.columns[name].tolist() if name in table.columns else [0] * len(table) for name in names]
    yield from (
        (time, number, list(values))
        for time, number, *values in zip(table.time.tolist(), table.number.tolist(), *columns, strict=True)
    )


def _text(value: object) -> str:
    return value.decode("utf-8", "replace").strip() if isinstance(value, bytes) else ""


def _messages(log: AutopilotLog) -> Iterator[Word]:
    for micros, number, (message,) in _rows(log.table("MSG"), "Message"):
        if text := _text(message):
            yield Word(micros, number, "message", "MSG", text)


def _vehicle(log: AutopilotLog) -> Mapping[str, str]:
    """Return the modes of the vehicle that the log's own messages name; nothing if none does."""
    said = [word.text for word in _messages(log)]
    for vehicle in _facts()["vehicles"].values():
        if any(text.startswith(tuple(vehicle["begins"])) for text in said):
            found: Mapping[str, str] = vehicle["modes"]
            return found
    return {}


def _modes(log: AutopilotLog) -> Iterator[Word]:
    modes, last = _vehicle(log), None
    numbered = "ModeNum" if "ModeNum" in log.table("MODE").columns else "Mode"
    for micros, number, (mode, reason) in _rows(log.table("MODE"), numbered, "Rsn"):
        if mode == last:
            continue
        name = modes.get(str(mode), f"mode {mode}")
        before = "" if last is None else f"{modes.get(str(last), f'mode {last}').partition(' (')[0]} -> "
        why = _facts()["reasons"].get(str(reason))
        yield Word(
            micros, number, "mode", "MODE", f"{before}{name}{f', why: {why}' if why else ''}",
            {"mode": mode, "reason": reason},
        )  # fmt: skip
        last = mode


def _armings(log: AutopilotLog) -> Iterator[Word]:
    for micros, number, (armed, forced, method) in _rows(log.table("ARM"), "ArmState", "Forced", "Method"):
        how = _facts()["methods"].get(str(method)) if "Method" in log.table("ARM").columns else None
        text = f"{'' if armed else 'dis'}armed{', forced' if forced else ''}{f', by: {how}' if how else ''}"
        yield Word(micros, number, "arming", "ARM", text, {"armed": armed, "method": method})


def _events(log: AutopilotLog) -> Iterator[Word]:
    told = len(log.table("ARM")) > 0
    for micros, number, (event,) in _rows(log.table("EV"), "Id"):
        arms = event in (_ARMED, _DISARMED)
        if not (arms and told):
            text = _facts()["events"].get(str(event), f"event {event}")
            yield Word(micros, number, "arming" if arms else "autopilot event", "EV", text, {"event": event})


def _errors(log: AutopilotLog) -> Iterator[Word]:
    modes, rows = _vehicle(log), list(_rows(log.table("ERR"), "Subsys", "ECode"))
    over = _overs(rows)
    for micros, number, (subsystem, code) in rows:
        known = _facts()["subsystems"].get(str(subsystem), {"name": f"subsystem {subsystem}"})
        said = known.get(str(code), f"code {code}")
        if "any" in known:
            named = modes.get(str(code), "").partition(" (")[0] if known["any"].endswith("mode") else ""
            said = f"{known['any']} {named or code}"
        yield Word(
            micros, number, "autopilot error", "ERR", f"{known['name']}: {said}",
            {"subsystem": subsystem, "code": code}, over.get(number) if "0" in known else None,
        )  # fmt: skip


def _overs(rows: list[tuple[int, int, list[Any]]]) -> Mapping[int, int]:
    """Return when errors were over, by their numbers: with the next code 0 of their subsystem."""
    found: dict[int, int] = {}
    open_: dict[Any, list[int]] = {}
    for micros, number, (subsystem, code) in rows:
        if code:
            open_.setdefault(subsystem, []).append(number)
        else:
            found |= dict.fromkeys(open_.pop(subsystem, ()), micros)
    return found


def _batteries(log: AutopilotLog) -> Iterator[Word]:
    """Yield when a battery was below what the vehicle's own parameters call low, for as long as they ask for."""
    settings = {_text(name): value for _, _, (name, value) in _rows(log.table("PARM"), "Name", "Value")}
    for record in ("BAT", "CURR"):
        table = log.table(record)
        if "Volt" not in table.columns:
            continue
        instance = next((name for name in ("Inst", "Instance") if name in table.columns), "")
        rows = list(_rows(table, "Volt", instance))
        for battery in sorted({one for _, _, (_, one) in rows}):
            prefix = "BATT_" if battery == 0 else f"BATT{battery + 1}_"
            lasting = settings.get(prefix + _LOW_TIMER, _USUAL_TIMER)
            mine = [(micros, number, volt) for micros, number, (volt, one) in rows if one == battery]
            for name, parameter in _LIMITS.items():
                limit = settings.get(prefix + parameter, 0)
                yield from (
                    Word(
                        micros, number, "low battery", record, f"battery {battery + 1} {name}: below {limit:.1f} V",
                        {"voltage": least, "limit": limit}, until,
                    )
                    for micros, number, until, least in _spells(mine, limit, lasting)
                )  # fmt: skip


def _spells(
    rows: list[tuple[int, int, float]], limit: float, lasting: float
) -> Iterator[tuple[int, int, int | None, float]]:
    """Yield first time, number, first time behind it and least voltage of each stretch below a limit that lasts."""
    below = [volt < limit for *_, volt in rows]
    edges = [k for k, (a, b) in enumerate(pairwise([False, *below, False])) if a != b]
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if rows[last - 1][0] - rows[first][0] >= lasting * 1e6:
            until = rows[last][0] if last < len(rows) else None
            yield rows[first][0], rows[first][1], until, min(volt for *_, volt in rows[first:last])
