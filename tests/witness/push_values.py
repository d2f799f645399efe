"""Proofs of PUSH-101 to PUSH-502 and BUS-038: values of packets, their answers, what they show of motors."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from witness.push_form import Piece, near, packets, pieces
from witness.views import MILLISECOND, SECOND, Finder, Found, Latest, Message, by_node, messages

if TYPE_CHECKING:
    from collections.abc import Iterator

    from witness.reader import Log

SET, FEEDBACK = "PUSHSCI.FocParameters", "PUSHCAN.FocFeedback"
QUERY, STATUS, CONTROL = "PUSHSCI.FocQuery", "PUSHCAN.MotorStatus", "PUSHSCI.OutputControl"
HELD = 2 * SECOND  # after the last throttle: no ESC holds it so long
TURNS = 500  # rpm
MOST_ESCS = 20
MODES = bytes.fromhex("00EE228866555A444A333A111ABB")
REST = bytes.fromhex("8866")  # lock and free are for motors at rest
TEN_THOUSAND, TURN = bytes.fromhex("555A444A333ABB"), bytes.fromhex("111A88")
SPEEDS, CURRENTS, MIRRORED = bytes.fromhex("333A"), bytes.fromhex("444A"), 0x1A
SHARED = ("acceleration_limit", "deceleration_limit", "rotation_direction", "led", "report_rate")

Wrong = Callable[[dict[str, Any]], bool]


def _where(name: str, wrong: Wrong) -> Finder:
    return lambda log: [piece.numbers for piece, values in packets(log, name) if wrong(values)]


def set_range(values: dict[str, Any]) -> bool:
    """PUSH-101: throttle priority and position loop are bytes 23 and 24; a field of ones is left as it is."""
    loop, priority = divmod(values["throttle_priority"], 256)
    small = (priority, loop, values["save_option"])
    rates = values["bus_rate"] not in {*range(6), 0xFF} or 400 < values["report_rate"] != 0xFFFF
    return rates or any(value not in {0, 1, 0xFF} for value in small)


def feedback_range(values: dict[str, Any]) -> bool:
    """PUSH-502: position loop, throttle priority, bus rate, report rate or save option out of range."""
    switches = values["position_loop"], values["throttle_priority"], values["save_option"]
    return values["bus_rate"] > 5 or values["report_rate"] > 400 or max(switches) > 1


def _sent(log: Log, name: str) -> dict[int, list[tuple[Piece, dict[str, Any]]]]:
    """The packets of a name by their unit."""
    found = defaultdict(list)
    for piece, values in packets(log, name):
        found[piece.unit].append((piece, values))
    return found


def _unanswered(name: str, answer: str, limit: int) -> Finder:
    """Packets that a unit, or one of all units seen so far, leaves unanswered for `limit` ns of the capture."""

    def find(log: Log) -> Found:
        answers, end, found = _sent(log, answer), log.frames[-1].t, []
        seen = [piece for piece in pieces(log) if piece.carried.name == "PUSHCAN" and piece.sound]
        for piece, _ in packets(log, name):
            units = {other.unit for other in seen if other.t < piece.t} if piece.unit == 0xFF else {piece.unit}
            times = [[other.t - piece.t for other, _ in answers[unit]] for unit in sorted(units)]
            silent = any(not any(0 < since <= limit for since in some) for some in times)
            if silent and piece.t + limit <= end:
                found.append(piece.numbers)
        return found

    return find


def differs(log: Log) -> Found:
    """PUSH-103: the first feedback within 1 s of the set values has another value; ones leave a value as it is."""
    feedback, found = _sent(log, FEEDBACK), []
    for piece, values in packets(log, SET):
        for answer, got in feedback.get(piece.unit, ()):
            if 0 < answer.t - piece.t <= SECOND:
                if _differs(values, got):
                    found.append(answer.numbers | piece.numbers)
                break
    return found


def _differs(values: dict[str, Any], got: dict[str, Any]) -> bool:
    pairs = [(values[name], got[name], 0xFFFF) for name in SHARED]
    pairs += [(values["throttle_priority"] & 0xFF, got["throttle_priority"], 0xFF)]
    pairs += [(values["bus_rate"], got["bus_rate"], 0xFF)]
    return any(wanted not in {ones, value} for wanted, value, ones in pairs)


def set_point(values: dict[str, Any]) -> bool:
    """PUSH-302: more than the mode's unit has."""
    mode, point = values["control_mode"], values["set_point"]
    return (mode in TEN_THOUSAND and point > 10_000) or (mode in TURN and point > 3600)


def pulse(values: dict[str, Any]) -> bool:
    """PUSH-403: a pulse that is neither within 1040..1940 us nor within 1050..1950 us; 0 is no signal."""
    return values["pwm"] != 0 and not 10_400 <= values["pwm"] <= 19_500


def temperature(values: dict[str, Any]) -> bool:
    """PUSH-405: below zero as int16, or kelvin by the hundred."""
    raw = values["temperature"]
    return raw >= 0x8000 or 23_315 <= raw <= 47_315


def backwards(log: Log) -> Found:
    """PUSH-407: fewer power-ons than before, or a shorter runtime that 16 bits which are full do not explain."""
    found = []
    for row in _sent(log, STATUS).values():
        by_src = defaultdict(list)
        for piece, values in row:
            by_src[piece.src].append((piece, values))
        for some in by_src.values():
            found += [piece.numbers for (old, was), (piece, now) in pairwise(some) if _less(was, now, piece.t - old.t)]
    return found


def _less(was: dict[str, Any], now: dict[str, Any], elapsed: int) -> bool:
    if now["power_on_count"] < was["power_on_count"]:
        return True
    wrapped = (now["runtime"] - was["runtime"]) % 65_536 <= elapsed / SECOND + 2
    return now["runtime"] < was["runtime"] and not wrapped


def at_limit(values: dict[str, Any]) -> bool:
    """PUSH-408: speed or current is as far as 16 bits go."""
    return abs(values["speed"]) >= 32_767 or abs(values["current"]) >= 32_767


def disagrees(log: Log) -> Found:
    """PUSH-409: voltage, speed or current is another than in the node's nearest ESCStatus, within 100 ms."""
    statuses = {src: Latest(sent) for src, sent in by_node(log, "ESCStatus").items()}
    found = []
    for piece, values in packets(log, STATUS):
        status = statuses[piece.src].nearest(piece.t, 100 * MILLISECOND) if piece.src in statuses else None
        if status is not None and not _agrees(values, status):
            found.append(piece.numbers)
    return found


def _agrees(values: dict[str, Any], status: Message) -> bool:
    return (
        near(values["voltage"] / 100, status["voltage"], 0.02)
        and near(values["speed"], status["rpm"], 0.05)
        and near(values["current"] / 100, status["current"], 0.10)
    )


def turning(log: Log) -> Found:
    """PUSH-305: what is only for motors at rest, within 1 s of an ESCStatus of 100 rpm or more of the one addressed."""
    asked = [(piece, piece.unit - 0xA1) for piece, values in packets(log, SET) if any(_sets(values))]
    asked += [(piece, piece.unit - 0xA1) for piece, values in packets(log, CONTROL) if values["control_mode"] in REST]
    asked += [(piece, piece.unit - 0xA1) for piece, _ in packets(log, "PUSHSCI.SetZero")]
    reports, found = defaultdict(list), []
    for one in messages(log, "ESCStatus"):
        reports[one["esc_index"]].append(one)
    for piece, index in asked:
        before = Latest(reports[index]).between(piece.t - SECOND, piece.t)
        if before and abs(before[-1]["rpm"]) >= 100:
            found.append(piece.numbers)
    return found


def _sets(values: dict[str, Any]) -> Iterator[bool]:
    yield values["save_option"] == 1
    kept = {"bus_rate": 0xFF, "save_option": values["save_option"]}
    yield from (values[name] != kept.get(name, 0xFFFF) for name in values)


def _follows(log: Log, wrong: Callable[[dict[str, Any], list[dict[str, Any]]], bool], modes: bytes) -> Found:
    """Control packets that are in force for 3 s, and from then on 1 s of three status packets or more that are wrong.

    Whoever repeats a packet changes nothing; throttle above zero on the unit's channel begins anew.
    """
    found, statuses = [], _sent(log, STATUS)
    driven: dict[int, list[int]] = defaultdict(list)
    for one in messages(log, "RawCommand"):
        for index, value in enumerate(one["cmd"]):
            if value > 0:
                driven[0xA1 + index].append(one.t)
    for unit, asked in _sent(log, CONTROL).items():
        for piece, order, end in _orders(asked, log.frames[-1].t):
            if order["control_mode"] not in modes:
                continue
            throttled = max((t for t in driven[unit] if t < end), default=0)
            since = max(piece.t, throttled) + 3 * SECOND
            shown = [(status, {**order, **values}) for status, values in statuses[unit] if since <= status.t < end]
            row: list[Piece] = []
            places: list[dict[str, Any]] = []
            for status, values in shown:
                places.append(values)
                row = [*row, status] if wrong(values, places) else []
                if len(row) >= 3 and row[-1].t - row[0].t >= SECOND:
                    found.append(piece.numbers.union(*(one.numbers for one in row)))
                    break
    return found


def _orders(asked: list[tuple[Piece, dict[str, Any]]], end: int) -> Iterator[tuple[Piece, dict[str, Any], int]]:
    """Each order of a unit, the first packet of it, and when another one takes its place."""
    first = 0
    for k, (_, values) in enumerate(asked):
        later = asked[k + 1] if k + 1 < len(asked) else None
        if later is None or any(later[1][name] != values[name] for name in ("control_mode", "set_point")):
            yield *asked[first], end if later is None else later[0].t
            first = k + 1


def ignored(values: dict[str, Any], _: list[dict[str, Any]]) -> bool:
    """PUSH-306: speed, current or position is far from what was asked for; signs say nothing."""
    mode, point = values["control_mode"], values["set_point"]
    if mode in SPEEDS:
        return abs(abs(values["speed"]) - point) > max(0.15 * point, 150)
    if mode in CURRENTS:
        return abs(abs(values["current"]) - point) > max(0.3 * point, 300)
    ends = (point, -point) if mode == MIRRORED else (point,)
    return all(_turn(values["position"], 10 * end) > 1000 for end in ends)


def unheld(values: dict[str, Any], before: list[dict[str, Any]]) -> bool:
    """PUSH-307: the rotor is not locked, or is and has moved since."""
    return values["system_status"] != 0x11 or _turn(values["position"], before[0]["position"]) > 1000


def _turn(one: int, other: int) -> int:
    """Hundredths of a degree between two positions, the shorter way."""
    return abs((one - other + 18_000) % 36_000 - 18_000)


def text(values: dict[str, Any]) -> bool:
    """PUSH-501: a byte before the padding (the first NUL, or spaces) that is no printable ASCII."""
    versions = [values[name].split(b"\0")[0].rstrip(b" ") for name in ("hardware_version", "software_version")]
    return any(not 0x20 <= byte <= 0x7E for version in versions for byte in version)


FINDERS: dict[str, Finder] = {
    "PUSH-101": _where(SET, set_range),
    "PUSH-102": _unanswered(SET, FEEDBACK, SECOND),
    "PUSH-103": differs,
    "PUSH-201": _unanswered(QUERY, FEEDBACK, SECOND),
    "PUSH-301": _where(CONTROL, lambda values: values["control_mode"] not in MODES),
    "PUSH-302": _where(CONTROL, set_point),
    "PUSH-303": _where(CONTROL, lambda values: values["reserved"] != 0),
    "PUSH-304": _unanswered(CONTROL, STATUS, 200 * MILLISECOND),
    "PUSH-305": turning,
    "PUSH-306": lambda log: _follows(log, ignored, SPEEDS + CURRENTS + bytes.fromhex("111A")),
    "PUSH-307": lambda log: _follows(log, unheld, bytes.fromhex("88")),
    "PUSH-401": _where(STATUS, lambda values: values["system_status"] not in {0x00, 0x11, 0xCC}),
    "PUSH-402": _where(STATUS, lambda values: values["position"] > 36_000),
    "PUSH-403": _where(STATUS, pulse),
    "PUSH-404": _where(STATUS, lambda values: values["throttle"] > 250),
    "PUSH-405": _where(STATUS, temperature),
    "PUSH-406": _where(STATUS, lambda values: values["motor_status"] != 0),
    "PUSH-407": backwards,
    "PUSH-408": _where(STATUS, at_limit),
    "PUSH-409": disagrees,
    "PUSH-410": _where(STATUS, lambda values: values["fault"] != 0),
    "PUSH-501": _where(FEEDBACK, text),
    "PUSH-502": _where(FEEDBACK, feedback_range),
}


def find_bus_038(log: Log) -> Found:
    """What an ESC says, from 2.0 s after its last throttle to the next one, while its motor turns and is driven."""
    commands = messages(log, "RawCommand")
    valid = [[one.t for one in commands if len(one["cmd"]) > k and one["cmd"][k] >= 0] for k in range(MOST_ESCS)]
    found: dict[tuple[int, int], set[int]] = {}
    for t, index, rpm, throttle, numbers in _said(log):
        past = bisect_left(valid[index], t) if index < MOST_ESCS else 0
        if past and t - valid[index][past - 1] >= HELD and abs(rpm) > TURNS and throttle:
            found.setdefault((index, past), set()).update(numbers)
    return list(found.values())


def _said(log: Log) -> Iterator[tuple[int, int, int, int, set[int]]]:
    """Time, index, speed, throttle and frames of each report of an ESC."""
    for one in messages(log, "ESCStatus"):
        yield one.t, one["esc_index"], one["rpm"], one["power_rating_pct"], one.numbers
    for piece, values in packets(log, "PUSHCAN.MotorStatus"):
        yield piece.t, piece.unit - 0xA1, values["speed"], values["throttle"], piece.numbers
