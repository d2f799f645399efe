"""Checks of single fields that pages describe: TYP-201 to -207, PUSH-301, -303, -402, and mistakes in such tests."""

from __future__ import annotations

from typing import Any

import pytest
from kit import encode
from kit.judged import exact, judge, registry
from kit.simulated import flight
from kit.traffic import MOTOR, STATUS, alive, lines

from analyzer.decode.engine import Engine
from analyzer.rules.catalogue import page
from analyzer.rules.field_tests import rules_from
from analyzer.rules.view import Past
from dissectors.toml_table import ProfileError, parse

TEXTS = {
    "TYP-201": "esc_index 25",
    "TYP-202": "esc_id_set 200",
    "TYP-203": "esc_timing 35",
    "TYP-204": "0x03 is neither PWM (0) nor CAN (1); high four bits 0, low four bits 3",
    "TYP-205": "esc_can_rate 9",
    "TYP-206": "esc_fdb_rate 1000 Hz",
    "TYP-207": "esc_save_option 2",
    "PUSH-301": "control mode 0x77",
    "PUSH-303": "bytes 10-11 are 0x0001",
    "PUSH-402": "365.00 degrees",
}
PAGE = """
["X-001"]
title = "t"
severity = "note"
category = "protocol"
origin = "heuristic"
enabled = true
checks = "c"
matters = "m"
example = "e"
next = "n"
text = "{field} {value}"
values = ["field", "value"]
exercised = "frames"
tests = [%s]
"""
UPTIME = '{ kind = "backwards", fields = ["uavcan.protocol.NodeStatus.uptime_sec"] }'


def rules(test: str, text: str = PAGE) -> list[Any]:
    table = parse((text % test).encode(), "rules.toml")
    return list(rules_from(registry(), {"X-001": page("X-001", table.table("X-001"))}))


def found(test: str, log: bytes, step: int = 1000, text: str = PAGE) -> list[dict[str, Any]]:
    """The values of every occurrence."""
    (rule,) = rules(test, text)
    past, engine, out = Past(registry(), {}), Engine(registry()), []
    rows = log.splitlines(keepends=True)
    for at in range(0, len(rows), step):
        for batch in [*engine.feed(b"".join(rows[at : at + step])), engine.flush()]:
            for one in rule.feed(past.feed(batch)):
                out += [one.values(k) for k in range(len(one.t))]
    return out


def parameters(**values: int) -> dict[str, Any]:
    names = [field for field, *_ in encode.parse(encode.TYPES["ParamGet"].layout)[1]]
    usual = dict.fromkeys(names, 0) | {"esc_timing": 15, "rsvd": []}
    return usual | values


def log(*sent: encode.Transfer) -> bytes:
    return lines(*(one.frames() for one in sent))


def up(seconds: int, transfer_id: int, node: int = 10) -> encode.Transfer:
    return alive(seconds, node, transfer_id)


@pytest.mark.slow
@pytest.mark.parametrize("rule", TEXTS)
def test_a_fault_of_the_simulator_is_found_where_the_witness_finds_it(rule: str) -> None:
    said = exact(rule, flight(f"{rule}@1"), step=7)
    assert [(one.count, one.text) for one in said] == [(1, TEXTS[rule])]


def test_a_clean_flight_has_none() -> None:
    assert judge(flight(seconds=2), tuple(TEXTS)) == []


@pytest.mark.parametrize(("value", "wrong"), [(0, True), (1, False), (29, False), (30, True), (255, True)])
def test_limits_are_inclusive_and_come_from_the_profile(value: int, wrong: bool) -> None:
    sent = encode.transfer("ParamGet", parameters(esc_timing=value), 12)
    assert bool(judge(log(sent), ("TYP-203",))) is wrong


def test_special_values_are_exempt_where_the_profile_has_them() -> None:
    names = [field for field, *_ in encode.parse(encode.TYPES["ParamCfg"].layout)[1]]
    kept = {name: -1 if base[0] == "i" else 0xFF for name, base, *_ in encode.parse(encode.TYPES["ParamCfg"].layout)[1]}
    wide = {name: 0xFFFF for name in names if name in {"esc_id_set", "esc_fdb_rate"}}
    sent = encode.transfer("ParamCfg", kept | wide, 126)
    assert judge(log(sent), tuple(TEXTS)) == []
    assert judge(log(encode.transfer("ParamCfg", kept | wide | {"esc_fdb_rate": 401}, 126)), ("TYP-206",)) != []


def test_a_scaled_limit_is_met_exactly() -> None:
    def position(raw: int) -> bytes:
        whole = encode.packet("PUSHCAN.MotorStatus", 0, 0xA1, **MOTOR | {"position": raw})
        return log(encode.transfer("PUSHCAN", {"data_sequence": 0, "data": list(whole)}, 10))

    assert judge(position(36000), ("PUSH-402",)) == []
    (one,) = judge(position(36001), ("PUSH-402",))
    assert one.text == "360.01 degrees"


def test_values_that_differ_are_findings_of_their_own() -> None:
    sent = [encode.transfer("ESCStatus", STATUS | {"esc_index": index}, 10, k) for k, index in enumerate((25, 31, 25))]
    said = judge(log(*sent), ("TYP-201",))
    assert [(one.key, one.count) for one in said] == [("value=25", 2), ("value=31", 1)]


@pytest.mark.parametrize("step", [1, 2, 1000])
def test_a_counter_that_runs_backwards(step: int) -> None:
    sent = log(up(5, 0), up(9, 0, node=11), up(6, 1), up(3, 2), up(4, 3), up(10, 1, node=11), up(1, 4))
    path = "uptime_sec"
    both = PAGE.replace('["field", "value"]', '["field", "value", "before"]')
    seen = [(one["field"], one["before"], one["value"]) for one in found(UPTIME, sent, step, both)]
    assert seen == [(path, 6, 3), (path, 4, 1)]


def test_counters_of_their_own() -> None:
    test = UPTIME.replace("] }", '], per = "mode" }')
    assert rules(test)
    assert found(test, log(up(5, 0), up(3, 1)))[0]["value"] == 3


@pytest.mark.parametrize(
    ("test", "reason"),
    [
        ("{ fields = ['ParamGet.esc_timing'] }", "kind is missing"),
        ("{ kind = 'odd', fields = ['ParamGet.esc_timing'] }", "'odd' is unknown"),
        ("{ kind = 'range' }", "fields is missing"),
        ("{ kind = 'range', fields = ['ParamGet.nothing'] }", "ParamGet has no whole number 'nothing'"),
        ("{ kind = 'range', fields = ['Nobody.field'] }", "no table of 'Nobody.field' is known"),
        ("{ kind = 'range', fields = ['ESCStatus.voltage'] }", "no whole number 'voltage'"),
        ("{ kind = 'range', fields = ['ParamGet.esc_uuid'] }", "has no limits"),
        ("{ kind = 'enum', fields = ['ParamGet.esc_timing'] }", "has no enumeration"),
        ("{ kind = 'enum', fields = ['ESCStatus.error_count.nothing'] }", "has no number 'nothing'"),
        ("{ kind = 'zero', fields = ['ParamGet.esc_timing'], low = 1 }", "only a range has limits"),
        ("{ kind = 'zero', fields = ['ParamGet.esc_timing'], per = 'esc_index' }", "only a counter"),
        ("{ kind = 'zero', fields = ['ParamGet.esc_timing'], hight = 1 }", "unknown key"),
    ],
)
def test_a_test_that_cannot_be_made_is_named_with_its_line(test: str, reason: str) -> None:
    with pytest.raises(ProfileError, match=reason) as error:
        rules(test)
    assert (error.value.file, error.value.line) == ("rules.toml", 15)


def test_a_page_may_ask_only_for_values_that_a_test_has() -> None:
    text = PAGE.replace('["field", "value"]', '["field", "value", "degrees"]')
    with pytest.raises(ProfileError, match="no value 'degrees'"):
        rules(UPTIME, text)
    assert rules(UPTIME.replace("] }", '], physical = "degrees" }'), text)


def test_a_range_of_the_test_itself() -> None:
    test = "{ kind = 'range', fields = ['uavcan.protocol.NodeStatus.uptime_sec'], low = 2, high = 4 }"
    assert [one["value"] for one in found(test, log(*(up(k, k) for k in range(1, 6))))] == [1, 5]
