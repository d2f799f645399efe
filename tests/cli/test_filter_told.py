"""What a command says of its filter, and of fields: names of what the capture does not have, and all that it wrote."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

HOVER, SERVICES, BREAK = CAPTURES / "hover.log", CAPTURES / "services.log", CAPTURES / "bus-break.log"


@pytest.mark.parametrize(
    ("capture", "text", "missing"),
    [
        (HOVER, "ahrs.Solution && src == 3", "no uavcan.equipment.ahrs.Solution"),
        (SERVICES, "MotorStatus", "no MotorStatus"),
        (SERVICES, "MotorStatus.voltage > 3 V", "no MotorStatus"),
        (SERVICES, "PUSHCAN.MotorStatus", "no PUSHCAN.MotorStatus"),
        (HOVER, "RestartNode && src == 3", "no uavcan.protocol.RestartNode"),
        (HOVER, "RestartNode.Request", "no uavcan.protocol.RestartNode.Request"),
    ],
)
def test_what_never_occurs_is_said(command: Command, capture: Path, text: str, missing: str) -> None:
    code, _, err = command("decode", capture, "-q", "-Y", text)
    assert code == 0
    assert f"has {missing}: the filter asks for what never occurs\n" in err


def test_one_of_two_is_enough(command: Command) -> None:
    assert "never occurs" not in command("decode", HOVER, "-q", "-Y", "ahrs.Solution || NodeStatus")[2]


@pytest.mark.parametrize("name", ["cut.log", "cut.mcap", "cut.pcapng"])
def test_error_frames_that_are_written_are_told(command: Command, tmp_path: Path, name: str) -> None:
    _, _, err = command("convert", BREAK, tmp_path / name, "-Y", "can.flags.err")
    assert err.startswith(f"-- 0 frames and 26 error frames written to {tmp_path / name}, 4232 do not match;")
    assert "26 error frames" in command("decode", "-q", tmp_path / name)[2]


def test_values_of_fields_are_whole(command: Command) -> None:
    _, out, _ = command("fields", "ParamCfg.esc_*")
    assert "  4294967295=all; clause" in out
    assert "  -1=no change; clause" in out
    assert "'-1=no change" in command("fields", "ParamCfg.esc_rotate_dir", "-T", "csv")[1]
    assert '{"4294967295": "all"}' in command("fields", "ParamCfg.esc_uuid", "-T", "json")[1]
