"""One value that cannot be is one finding, of the rule for T-Motor's document, and of no general one beside it."""

from __future__ import annotations

import pytest
from kit import encode
from kit.judged import judge, registry
from kit.traffic import capture

from analyzer.rules.noted import NotedFields

TABLES = (
    "RawCommand", "ParamCfg", "ParamGet", "ESCStatus", "PUSHSCI", "PUSHCAN", "PUSHSCI.SetZero", "PUSHSCI.FocParameters",
    "PUSHSCI.FocQuery", "PUSHSCI.OutputControl", "PUSHCAN.MotorStatus", "PUSHCAN.FocFeedback",
)  # fmt: skip
RULES = ("TYP-013", "TYP-014", "TYP-201", "TYP-202", "PUSH-302")
GET = dict.fromkeys(
    ("esc_ov_threshold", "esc_oc_threshold", "esc_ot_threshold", "esc_acc_threshold", "esc_dacc_threshold",
     "esc_rotate_dir", "esc_startup_times", "esc_startup_duration", "esc_product_date", "esc_error_count",
     "esc_signal_priority", "esc_led_mode", "esc_can_rate", "esc_fdb_rate", "esc_save_option"), 1,
) | {"esc_index": 0, "esc_id_req": 0, "esc_uuid": 7, "esc_timing": 15, "rsvd": []}  # fmt: skip


def test_every_field_with_limits_or_names_has_a_rule_of_its_own() -> None:
    general = NotedFields(registry())
    assert [f"{name}.{column.name}" for name in TABLES for column in general._of(name)] == []


@pytest.mark.parametrize(
    ("index", "number", "found"),
    [
        (0, 99, ["TYP-202 esc_id_req 99"]), (99, 99, ["TYP-201 esc_index 99"]), (99, 0, ["TYP-201 esc_index 99"]),
        (99, 98, ["TYP-201 esc_index 99", "TYP-202 esc_id_req 98"]), (0, 0xFF, []), (0, 0xFFFF, []), (19, 19, []),
    ],
)  # fmt: skip
def test_an_id_in_the_answer_of_an_esc(index: int, number: int, found: list[str]) -> None:
    text = capture([(0.0, 12, "ParamGet", GET | {"esc_index": index, "esc_id_req": number})])
    assert sorted(f"{one.rule} {one.text}" for one in judge(text, RULES)) == found


@pytest.mark.parametrize(
    ("mode", "point", "count"), [(0x33, 12_000, 1), (0x11, 3601, 1), (0x33, 10_000, 0), (0x66, 60_000, 0)]
)
def test_a_set_point(mode: int, point: int, count: int) -> None:
    packet = encode.packet("PUSHSCI.OutputControl", 0, 0xA1, control_mode=mode, set_point=point)
    assert [one.rule for one in judge(capture([(0.0, 126, "PUSHSCI", packet)]), RULES)] == ["PUSH-302"] * count
