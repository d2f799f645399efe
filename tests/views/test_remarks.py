"""What lines of the list say behind the numbers: modes, faults, changes, and of settings only what they change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.flight import OPEN
from kit.traffic import MS, START, TURNING, capture, motor
from kit.vendors import COUNTER_CLOCKWISE

import dissectors
from analyzer.views.listing import Listing
from analyzer.views.times import TimeFormat
from dissectors.toml_table import ProfileError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry

    Decode = Callable[..., Any]

IDLE, OPERATING, ERROR = 2 << 12, 4 << 12, 6 << 12
HOT, STALL, STARVED = 1 << 5, 1 << 7, 1 << 1
SYSTEM_FAULT, LOCKED = 0xCC, 0x11


def infos(got: Any, registry: Registry) -> list[str]:
    """What lines say, without their first columns."""
    view = Listing(registry, TimeFormat("r"))
    lines = [line for batch in got.batches for line in view.lines(batch)]
    start = lines[0].index("Info")
    return [line[start:] for line in lines[1:]]


def said(decode: Decode, registry: Registry, *planned: tuple[int, str, Any], cut: object = None) -> list[str]:
    """What lines say of messages that nodes send one after the other; `cut` ends a batch behind each frame."""
    text = capture((10.0 * k, node, name, what) for k, (node, name, what) in enumerate(planned)).encode()
    chunks = [text] if cut is None else [part for line in text.splitlines(keepends=True) for part in (line, cut)]
    return infos(decode(*chunks, types=registry), registry)


def reports(*words: int, node: int = 11, **more: Any) -> list[tuple[int, str, Any]]:
    return [(node, "ESCStatus", TURNING | {"error_count": word} | more) for word in words]


def test_mode_and_faults(decode: Decode, registry: Registry) -> None:
    hot = {"voltage": 47.8, "current": 0.1, "temperature": 120.0, "rpm": 0, "power_rating_pct": 0, "esc_index": 6}
    numbers = "ch1 48.5V 1.2A 41C 3011rpm 40%"
    assert said(
        decode, registry, *reports(ERROR | HOT, **hot),
        *reports(OPERATING, node=12), *reports(OPERATING | STALL | STARVED, node=13), *reports(9 << 12, node=12),
    ) == [
        "ch7 47.8V 0.1A 120C 0rpm 0% ERROR MODE, MOS over temperature",
        numbers,
        f"{numbers} under voltage, stall",
        f"{numbers} operating -> 9 (undefined) mode",
    ]  # fmt: skip


@pytest.fixture(params=[False, True], ids=["whole", "cut"])
def cut(request: pytest.FixtureRequest, flush: object) -> object:
    return flush if request.param else None


def test_changes_have_both_names_wherever_batches_end(decode: Decode, registry: Registry, cut: object) -> None:
    sent = [*reports(IDLE, IDLE, OPERATING, OPERATING, ERROR), *reports(OPERATING, node=12), *reports(ERROR, OPERATING)]
    two = [(14, "ESCStatus", TURNING | {"error_count": (IDLE, OPERATING)[k % 2], "esc_index": k % 2}) for k in range(4)]
    found = [line.partition("%")[2].strip() for line in said(decode, registry, *sent, *two, cut=cut)]
    assert found == [
        "idle mode", "idle mode", "idle -> operating mode", "", "operating -> ERROR MODE", "", "ERROR MODE",
        "error -> operating mode", "idle mode", "", "idle mode", "",
    ]  # fmt: skip


def test_a_damaged_report_changes_nothing(decode: Decode, registry: Registry) -> None:
    sent = [*reports(OPERATING), *reports(ERROR), *reports(OPERATING)]
    frames = capture((10.0 * k, *one) for k, one in enumerate(sent)).splitlines()
    head, data = frames[5].split("#")
    frames[5] = f"{head}#{int(data[0], 16) ^ 1:X}{data[1:]}"
    found = [line.partition("%")[2] for line in infos(decode("\n".join([*frames, ""]).encode()), registry)]
    assert found[0] == found[2] == ""
    assert found[1].startswith(" ERROR MODE bad CRC")


def test_a_counter_of_errors_has_no_faults(decode: Decode, registry: Registry, cut: object) -> None:
    """4.4.3: of a node that counts errors the first word is no status."""
    packet = (12, "PUSHCAN", motor(0))
    lines = said(decode, registry, packet, *reports(7), *reports(0), *reports(7, node=12), cut=cut)
    assert [line.partition("%")[2].strip() for line in lines if line.startswith("ch")] == [
        "", "", "0 (undefined) mode, over voltage, under voltage, over current",
    ]  # fmt: skip


def test_packets_of_motors(decode: Decode, registry: Registry) -> None:
    states = [0, LOCKED, SYSTEM_FAULT, 0]
    sent = [(11, "PUSHCAN", motor(k, system_status=state)) for k, state in enumerate(states)]
    other = (11, "PUSHCAN", motor(9, unit=0xA2, fault=HOT))
    lines = said(decode, registry, sent[0], other, *sent[1:])
    assert [line.partition("%")[2].rpartition(" | ")[0].strip() for line in lines] == [
        "", "MOS over temperature", "no rotor lock -> rotor lock", "rotor lock -> FAULT", "fault -> no rotor lock",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("width", "shown"),
    [
        (50, "c..."),
        (80, "ch1 48.5V... ERROR MODE, MOS over..."),
        (91, "ch1 48.5V... ERROR MODE, MOS over temperature"),
        (112, "ch1 48.5V 1.2A 41C 3011rpm 40% ERROR MODE, MOS over temperature"),
    ],
)
def test_what_is_remarked_goes_before_numbers_where_not_all_fits(
    decode: Decode, registry: Registry, width: int, shown: str
) -> None:
    got = decode(capture((10.0, *one) for one in reports(OPERATING, ERROR | HOT)[1:]).encode())
    view = Listing(registry, TimeFormat("r"), width=width)
    _, line = [line for batch in got.batches for line in view.lines(batch)]
    assert line[48:] == shown.replace("...", "…")
    assert len(line) <= width


def test_settings_list_what_they_change(decode: Decode, registry: Registry) -> None:
    change = {"esc_index": 3, "esc_uuid": 0xA0, "esc_fdb_rate": 50, "esc_can_rate": 1, "esc_save_option": 1}
    names = "over_voltage_threshold over_current_threshold over_temperature_threshold beep_volume acceleration_limit"
    packet = dict.fromkeys(f"{names} deceleration_limit rotation_direction throttle_priority led".split(), 0xFFFF)
    packet |= {"esc_id": 2, "bus_rate": 0xFF, "report_rate": 100, "save_option": 0, "throttle_priority": 1}
    lines = said(
        decode, registry,
        (125, "ParamCfg", OPEN), (125, "ParamCfg", OPEN | change),
        (125, "ParamCfg", OPEN | {"esc_id_set": 7, "esc_led_mode": 0x197, "esc_rotate_dir": 1}),
        (125, "PUSHSCI", encode.packet("PUSHSCI.FocParameters", 0, 0xA2, **packet)),
    )  # fmt: skip
    assert lines == [
        "index all uuid all: changes nothing",
        "index 3 uuid 000000A0: bus at 500 kbps, reports at 50 Hz, permanent",
        "index all uuid all: ID 7, rotation direction 1, LED 7 at 2.5 Hz",
        "FocParameters unit 2: ID 2, throttle from CAN, position loop off, reports at 100 Hz, temporary | sequence 0",
    ]


def test_another_vendor(decode: Decode, registry: Registry) -> None:
    words = (0, 0, COUNTER_CLOCKWISE)
    frames = [
        frame
        for k, word in enumerate(words)
        for frame in encode.transfer(
            "com.hobbywing.esc.StatusMsg1", {"rpm": 100, "pwm": 5, "status": word}, 11, k
        ).frames(START + 10 * k * MS)
    ]
    lines = infos(decode("".join(encode.log_line(frame) + "\n" for frame in frames).encode(), types=registry), registry)
    assert [line.partition("status ")[2] for line in lines] == [
        "0000 clockwise", "0000 clockwise", "4000 clockwise -> counter-clockwise",
    ]  # fmt: skip


PROFILE = """\
[enum.State]
0 = "idle"
2 = "spinning"

[message.Pump]
dsdl = "20777.Pump.uavcan"
type = "acme.Pump"
summary = "{flow}"
field.state = { enum = "State" }
field.level = { unit = "l", scale = "1/10", special = { 255 = "unknown" } }
field.flags = { bits = { dry = 0, leak = { at = "3", title = "Leak!" } } }
remarks = [
    REMARKS
]
"""
DSDL = "uint8 flow\nuint8 state\nuint8 level\nuint8 flags\n"


def folder_of(tmp_path: Path, remarks: str) -> Path:
    folder = tmp_path / "acme"
    folder.mkdir()
    (folder / "profile.toml").write_text(PROFILE.replace("REMARKS", remarks))
    (folder / "20777.Pump.uavcan").write_text(DSDL)
    return folder


@pytest.mark.parametrize(
    ("remarks", "lines"),
    [
        ('{ of = "state" }', ["1 idle", "2 spinning", "3 7 (undefined)"]),
        ('{ of = "state", usual = [0, 2] }', ["1", "2", "3 7 (undefined)"]),
        (
            '{ of = "state", usual = [0], text = "now {state} at {flow}" }',
            ["1", "2 now spinning at 2", "3 now 7 (undefined) at 3"],
        ),
        ('{ of = "level" }', ["1 1 l", "2", "3 2.5 l"]),
        ('{ of = "level", usual = [10], text = "{level:.2f} l" }', ["1", "2", "3 2.50 l"]),
        ('{ of = "flags" }', ["1", "2 dry, Leak!", "3 dry"]),
        (
            '{ of = "flags.leak", changes = true }, { text = "tight" }',
            ["1 tight", "2 no Leak! -> Leak!", "3 Leak! -> no Leak!"],
        ),
        ('{ of = "flow", usual = [2], capitals = [3], text = "x{flow:02x}" }', ["1 x01", "2", "3 X03"]),
    ],
)  # fmt: skip
def test_a_profile_says_what_is_remarked(decode: Decode, tmp_path: Path, remarks: str, lines: list[str]) -> None:
    types = dissectors.load([folder_of(tmp_path, remarks)])
    signature = types.signatures(0, 20777)[0]
    assert signature is not None
    rows = [bytes([1, 0, 10, 0]), bytes([2, 2, 255, 9]), bytes([3, 7, 25, 1])]
    sent = [encode.Transfer("message", 20777, 5, row, signature, k) for k, row in enumerate(rows)]
    text = "".join(encode.log_line(frame) + "\n" for k, one in enumerate(sent) for frame in one.frames(START + k * MS))
    assert infos(decode(text.encode(), types=types), types) == lines


@pytest.mark.parametrize(
    ("remarks", "reason"),
    [
        ('{ of = "nothing" }', "'nothing' is no whole number"),
        ('{ of = "state", text = "{nothing}" }', "no column 'nothing'"),
        ('{ of = "flow", changes = true }', "only a flag, or a column whose values have names"),
        ('{ of = "state", per = "nothing" }', "'nothing' is no whole number"),
        ('{ of = "state", only = "dialect=tm" }', "no reading of this message"),
        ('{ of = "state", only = "tm" }', "READING=CHOICE"),
        ("{ usual = [1] }", "`of` a column"),
        ('{ text = "x", changes = true }', "`of` a column"),
        ('{ of = "state", mode = 1 }', "mode: unknown key"),
        ('{ of = "state", usual = [1.5] }', "whole numbers"),
    ],
)  # fmt: skip
def test_mistakes_are_told(tmp_path: Path, remarks: str, reason: str) -> None:
    folder = folder_of(tmp_path, remarks)
    with pytest.raises(ProfileError, match=r"profile\.toml:12: ") as caught:
        dissectors.load([folder])
    assert reason in str(caught.value)
