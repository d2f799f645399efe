"""Every type of Hobbywing's ESCs as another encoder sends it, beside what the public DSDL and its users say of it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import dronecan
import pytest
from dronecan.dsdl import CompoundType
from kit import VECTORS, encode
from kit.traffic import differing
from kit.vendors import physical

from dissectors.registry import load

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.profile import Profile
    from dissectors.registry import Registry
    from dissectors.schema import Message

SENT = json.loads((VECTORS / "hobbywing.json").read_text())
TEXT = (VECTORS / "hobbywing.log").read_text()
SPACE = "com.hobbywing.esc."
SHOWN = {  # line of the vectors: what the list says of it
    1: "node 0 channel -",
    2: "node 13 channel 3",
    4: "4321rpm pwm 812 status 4000 counter-clockwise",
    6: "50.3V -1.7A 104C",
    8: "MOS 105C capacitor 61C motor 149C",
    9: "100 0 -100 50 %",
    14: "request: node 14 channel 4",
    16: "request: 200 kbps",
    18: "request: yellow 5 Hz",
    20: "request: query",
    23: "response: write StatusMsg3 10 Hz",
    27: "response: fail",
    31: "response: turned 123456min, 70000min since maintenance",
    33: "response: channel 3 counter-clockwise throttle CAN Msg1 50 Hz Msg2 10 Hz",
}


@pytest.fixture(scope="module")
def profile(registry: Registry) -> Profile:
    """The folder, among those that are loaded without being asked for."""
    return next(profile for profile in registry.profiles if profile.folder.name == "hobbywing")


def halves(profile: Profile) -> dict[str, Message]:
    return {message.table: message for message in profile.dissector().messages}


def test_signatures_and_layouts_are_those_of_the_public_types(profile: Profile) -> None:
    public = {name: known for name, known in dronecan.TYPENAMES.items() if name.startswith(SPACE)}
    own = halves(profile)
    assert {message.full_name for message in own.values()} == set(public)
    for message in own.values():
        known = public[message.full_name]
        assert (message.type_id, message.signature) == (known.default_dtid, known.get_data_type_signature())
        service = known.kind == CompoundType.KIND_SERVICE
        fields = known.fields if not service else getattr(known, f"{message.kind}_fields")
        assert [field.name for field in fields] == [field.name for field in message.layout.fields]
        assert message.layout.max_bits == sum(field.type.get_max_bitlen() for field in fields)


def test_the_vectors_hold_every_half_of_every_type(profile: Profile) -> None:
    assert {one["type"] for one in SENT} == set(halves(profile))


def test_what_another_encoder_sent_is_what_is_shown(decode: Callable[..., Any]) -> None:
    got = decode(TEXT.encode())
    assert {row["status"] for row in got.transfers} == {"ok"}
    assert len(got.transfers) == len(SENT)
    for number, (one, row) in enumerate(zip(SENT, got.transfers, strict=True)):
        assert [frame + 1 for frame in row["frame"]] == one["lines"]
        assert (row["type_id"], row["src"], row["dst"]) == (one["type_id"], one["source"], one["dest"])
        table, message = got.message_of(number)
        assert table == one["type"]
        assert message["bits_left"] >= 0
        assert differing(physical(table, one["fields"]), message) == {}, one


@pytest.mark.parametrize("one", SENT[::4], ids=lambda one: one["type"].removeprefix(SPACE))
def test_the_sender_of_these_tests_agrees(one: dict[str, Any]) -> None:
    if one["type"] not in encode.TYPES:
        return
    sent = encode.transfer(
        one["type"], one["fields"], one["source"], one["transfer_id"], priority=16, dst=one["dest"]
    ).frames()
    lines = TEXT.splitlines()
    assert [encode.log_line(frame).split()[2] for frame in sent] == [lines[k - 1].split()[2] for k in one["lines"]]


def test_the_list_says_it_in_a_line(command: Any, tmp_path: Any) -> None:
    path = tmp_path / "sent.log"
    path.write_text(TEXT)
    _, out, _ = command("decode", str(path))
    said = {int(line.split()[0]): line for line in out.splitlines()[1:]}
    assert {number: said[number].endswith(text) for number, text in SHOWN.items()} == dict.fromkeys(SHOWN, True)


def test_no_folder_has_to_be_named(registry: Registry) -> None:
    """The registry takes every vendor of the package, T-Motor's document first, the standard types last."""
    assert [profile.name for profile in load().profiles] == ["TM-UAVCAN", "Hobbywing", "DroneCAN"]
    assert registry.resolve("StatusMsg2").notes["current"].unit == "A"
    assert registry.resolve("RawCommand").full_name == "uavcan.equipment.esc.RawCommand"


def test_no_type_of_one_vendor_hides_that_of_another(registry: Registry) -> None:
    """Types of different folders that share an ID would be told apart by their CRC alone."""
    vendors = registry.profiles[:2]
    ids = [{(offer.type_id, offer.service) for offer in vendor.offers()} for vendor in vendors]
    assert not ids[0] & ids[1]


def test_what_moves_a_motor_or_changes_an_esc_is_known(profile: Profile) -> None:
    assert {name.removeprefix(SPACE) for name, message in halves(profile).items() if message.actuates} == {
        "RawCommand",
        *(f"{service}.Request" for service in (
            "SetID", "SetBaud", "SetLED", "SetDirection", "SetReportingFrequency", "SetThrottleSource", "SelfTest",
            "SetAngle", "GetMaintenanceInformation",
        )),
    }  # fmt: skip


def test_a_vendor_of_its_own_needs_no_python(profile: Profile) -> None:
    assert profile.code == ""
    assert {path.suffix for path in profile.folder.rglob("*.*")} == {".toml", ".uavcan"}
