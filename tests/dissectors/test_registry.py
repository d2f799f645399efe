"""The registry: which folder answers for an ID or a name, vendors outside the repository, and what loading costs."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from fractions import Fraction
from importlib import invalidate_caches
from pathlib import Path

import pytest

import dissectors
from dissectors import installed, registry
from dissectors.dsdl import DsdlError
from dissectors.profile import ProfileError
from dissectors.registry import UnknownNameError, load

MESSAGE, ANONYMOUS, REQUEST, RESPONSE = range(4)
TABLE_4_3_1 = {
    1030: ("RawCommand", 0x217F5C87D7EC951D),
    1033: ("ParamCfg", 0x948F5E0B33E0EDEE),
    1034: ("ESCStatus", 0xA9AF28AEA2FBB254),
    1038: ("PUSHSCI", 0xCE2B6D6B6BDC0AE8),
    1039: ("PUSHCAN", 0xAACF9B4B2577BC6E),
    1332: ("ParamGet", 0x462875A0ED874302),
}


@pytest.fixture(scope="module")
def known() -> registry.Registry:
    return load()


@pytest.mark.parametrize("type_id", TABLE_4_3_1)
def test_the_document_wins_over_the_public_types(known: registry.Registry, type_id: int) -> None:
    name, signature = TABLE_4_3_1[type_id]
    message = known.message(MESSAGE, type_id)
    assert message is not None
    assert (message.name, message.table, message.type_id) == (name, name, type_id)
    assert message.signature == known.signatures(0, type_id)[0] == signature


def test_standard_types_resolve_as_message_and_as_service(known: registry.Registry) -> None:
    """IDs of messages and services are separate: 5 is Panic and RestartNode."""
    assert known.message(MESSAGE, 5).table == "uavcan.protocol.Panic"
    assert known.message(REQUEST, 5).table == "uavcan.protocol.RestartNode.Request"
    assert known.message(RESPONSE, 5).table == "uavcan.protocol.RestartNode.Response"
    assert known.message(ANONYMOUS, 1).table == "uavcan.protocol.dynamic_node_id.Allocation"
    assert known.signatures(1, 1)[0] == 0xEE468A8121C46A9E
    assert known.signatures(0, 341)[0] == 0x0F0868D0C1A7C6F1
    assert known.message(REQUEST, 1).signature == known.message(RESPONSE, 1).signature


def test_unknown_ids_have_no_answer(known: registry.Registry) -> None:
    for kind in range(4):
        assert known.message(kind, 60000) is None
    assert known.signatures(0, 60000) == []
    assert known.signatures(1, 999) == []
    assert known.message(REQUEST, 341) is None


def test_carriers_are_the_messages_with_packets(known: registry.Registry) -> None:
    assert [message.name for message in known.carriers()] == ["PUSHSCI", "PUSHCAN"]


def test_each_table_has_one_definition(known: registry.Registry) -> None:
    packet = known.packets["PUSHCAN.MotorStatus"]
    assert known.definition("PUSHCAN.MotorStatus") is packet
    assert known.message_of("PUSHCAN.MotorStatus") is None
    assert known.definition("ESCStatus") is known.message_of("ESCStatus") is known.resolve("ESCStatus")
    for name in ("escstatus", "esc.Status", "PUSHCAN.Nothing", ""):  # an exact name of a table, and no other
        assert known.definition(name) is None
    assert known.table_of("PUSHCAN.MotorStatus.rpm.part") == "PUSHCAN.MotorStatus"
    assert known.table_of("uavcan.protocol.NodeStatus.mode") == "uavcan.protocol.NodeStatus"
    assert known.table_of("ESCStatus") == known.table_of("Nothing.rpm") == ""


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("ESCStatus", "ESCStatus"),
        ("uavcan.equipment.esc.Status", "ESCStatus"),
        ("esc.Status", "ESCStatus"),
        ("com.tmotor.esc.PUSHCAN", "PUSHCAN"),
        ("RawCommand", "RawCommand"),
        ("com.hobbywing.esc.RawCommand", "com.hobbywing.esc.RawCommand"),
        ("NodeStatus", "uavcan.protocol.NodeStatus"),
        ("nodestatus", "uavcan.protocol.NodeStatus"),
        ("uavcan.protocol.GetNodeInfo.Response", "uavcan.protocol.GetNodeInfo.Response"),
        ("GetNodeInfo.Request", "uavcan.protocol.GetNodeInfo.Request"),
    ],
)
def test_names_long_and_short(known: registry.Registry, name: str, table: str) -> None:
    assert known.resolve(name).table == table


@pytest.mark.parametrize(
    ("name", "candidates"),
    [
        ("GetNodeInfo", {"uavcan.protocol.GetNodeInfo.Request", "uavcan.protocol.GetNodeInfo.Response"}),
        ("gnss.Status", None),
        ("Status", {"ESCStatus", "uavcan.equipment.actuator.Status", "uavcan.equipment.hardpoint.Status"}),
        ("NodeStats", {"NodeStatus"}),
        ("", set()),
        ("}{", set()),
    ],
)
def test_doubtful_names_give_candidates(known: registry.Registry, name: str, candidates: set[str] | None) -> None:
    if candidates is None:
        assert known.resolve(name).table == "ardupilot.gnss.Status"
        return
    with pytest.raises(UnknownNameError) as caught:
        known.resolve(name)
    assert set(caught.value.candidates) >= candidates
    assert all(candidate in str(caught.value) for candidate in candidates)


def test_every_name_that_is_listed_resolves_to_itself(known: registry.Registry) -> None:
    names = known.names()
    assert len(set(names)) == len(names) > 150
    assert "com.tmotor.esc.PUSHCAN" not in names
    for name in names:
        assert known.resolve(name).table == name


def vendor(folder: Path) -> Path:
    (folder / "acme" / "power").mkdir(parents=True)
    (folder / "acme" / "power" / "20900.Cell.uavcan").write_text(
        "uavcan.Timestamp stamp\nState state\nuint16 millivolt\nuint8[<=4] text\n"
    )
    (folder / "acme" / "power" / "State.uavcan").write_text("@union\nuint8 code\nbool ok\n")
    (folder / "acme" / "200.Reset.uavcan").write_text("uint8 level\n---\nbool done\n")
    return folder


def test_a_vendor_is_a_folder_of_dsdl(tmp_path: Path) -> None:
    """Names come from the folders; nested types may be the vendor's or the standard's."""
    known = load([vendor(tmp_path / "dsdl")])
    cell = known.message(MESSAGE, 20900)
    assert cell.table == "acme.power.Cell"
    assert cell.plan()[:5] == [("struct", 4, 0), ("struct", 1, 0), ("uint", 56, 0), ("union", 2, 1), ("uint", 8, 0)]
    assert (cell.min_bytes, cell.max_bytes) == (10, 15)
    assert known.message(REQUEST, 200).table == "acme.Reset.Request"
    assert known.resolve("Cell") is cell
    assert known.message(MESSAGE, 1030).name == "RawCommand"


def test_a_vendor_profile_adds_meaning(tmp_path: Path) -> None:
    folder = vendor(tmp_path / "dsdl")
    (folder / "profile.toml").write_text(
        'name = "Acme"\ntree = "."\n[message."acme.power.Cell"]\nsummary = "{volt:.3f} V"\n'
        'derived.volt = { source = "millivolt", scale = "1/1000", unit = "V" }\nfield.text = { text = true }\n'
        '[message.Beat]\ndsdl = "beat/20901.Beat.uavcan"\ntype = "acme.Beat"\naliases = ["acme.old.Beat"]\n'
    )
    (folder / "beat").mkdir()
    (folder / "beat" / "20901.Beat.uavcan").write_text("uint8 count\n")
    known = load([folder])
    cell, beat = known.message(MESSAGE, 20900), known.message(MESSAGE, 20901)
    assert (cell.derived[0].name, cell.derived[0].scale, cell.notes["text"].text) == ("volt", Fraction(1, 1000), True)
    assert (beat.name, beat.full_name) == ("Beat", "acme.Beat")
    assert known.resolve("acme.old.Beat") is beat
    assert known.message(RESPONSE, 200).table == "acme.Reset.Response"
    assert not [name for name in known.names() if name.startswith("beat.")]


def test_one_id_cannot_name_two_types_of_a_folder(tmp_path: Path) -> None:
    folder = vendor(tmp_path / "dsdl")
    (folder / "acme" / "20900.Other.uavcan").write_text("uint8 x\n")
    with pytest.raises(DsdlError, match="has the data type ID 20900 already"):
        load([folder])
    (folder / "acme" / "20900.Other.uavcan").unlink()
    (folder / "acme" / "200.Beat.uavcan").write_text("uint8 x\n")
    assert load([folder]).message(MESSAGE, 200).table == "acme.Beat"


def test_files_beside_the_profile_take_the_folder_as_namespace(tmp_path: Path) -> None:
    folder = tmp_path / "acme"
    folder.mkdir()
    (folder / "20900.Ping.uavcan").write_text("uint8 count\n")
    (folder / "deep").mkdir()
    (folder / "deep" / "20901.Pong.uavcan").write_text("acme.Ping ping\n")
    known = load([folder])
    assert known.message(MESSAGE, 20900).table == "acme.Ping"
    assert known.resolve("Pong").table == "acme.deep.Pong"


def test_a_users_folder_wins_over_all_others(tmp_path: Path) -> None:
    folder = tmp_path / "acme"
    folder.mkdir()
    (folder / "1034.Mine.uavcan").write_text("uint8 x\n")
    known = load([folder])
    assert known.message(MESSAGE, 1034).table == "acme.Mine"
    assert known.message(MESSAGE, 1034, 1).table == "ESCStatus"  # another signature: a CRC can still tell
    assert known.message(MESSAGE, 1034, 2) is None
    assert {"ESCStatus", "acme.Mine"} <= set(known.names())
    assert known.message(MESSAGE, 1030).name == "RawCommand"


def test_mistakes_in_a_users_folder_show_when_it_is_loaded(tmp_path: Path) -> None:
    folder = tmp_path / "acme"
    folder.mkdir()
    (folder / "20900.Ping.uavcan").write_text("\nuint8\n")
    with pytest.raises(DsdlError, match=r"20900\.Ping\.uavcan:2: a name is expected"):
        load([folder])
    with pytest.raises(ProfileError, match="no such folder"):
        load([tmp_path / "gone"])


def test_installed_packages_offer_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "acme_dissector"
    vendor(package / "dsdl")
    (package / "__init__.py").write_text(
        "from pathlib import Path\nFOLDER = Path(__file__).parent / 'dsdl'\nNONE = None\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert load().message(MESSAGE, 20900) is None
    about = tmp_path / "acme_dissector-1.0.Dist-Info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme_dissector\nVersion: 1.0\n")
    points = about / "entry_points.txt"
    points.write_text(f"[{installed.GROUP}]\nacme = acme_dissector:FOLDER\n")
    invalidate_caches()
    assert load().message(MESSAGE, 20900).table == "acme.power.Cell"
    for broken in ("acme_dissector:NONE", "acme_dissector:GONE", "no_such_module_here:X"):
        points.write_text(f"[{installed.GROUP}]\nacme = {broken}\n")
        with pytest.raises(ProfileError, match="gives no folder"):
            load()


def test_a_package_in_an_archive_offers_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vendor(tmp_path / "dsdl")
    with zipfile.ZipFile(tmp_path / "acme.zip", "w") as archive:
        archive.writestr("acme_in_zip.py", f"FOLDER = {str(tmp_path / 'dsdl')!r}\n")
        archive.writestr("acme-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
        archive.writestr("acme-1.0.dist-info/entry_points.txt", f"[{installed.GROUP}]\nacme = acme_in_zip:FOLDER\n")
    monkeypatch.syspath_prepend(tmp_path / "acme.zip")
    assert load().message(MESSAGE, 20900).table == "acme.power.Cell"


def test_loading_reads_no_other_package_and_nothing_at_home(tmp_path: Path) -> None:
    """pydronecan reads vendor folders in the home directory when it is imported; here nothing may."""
    for name in ("uavcan_vendor_specific_types", "dronecan_vendor_specific_types"):
        (tmp_path / name / "acme").mkdir(parents=True)
        (tmp_path / name / "acme" / "20900.Ping.uavcan").write_text("uint8 x\n")
    code = (
        "import sys; home, opened = sys.argv[1], []\n"
        "watched = ('open', 'os.scandir', 'os.listdir')\n"
        "sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event in watched and args else None)\n"
        "import dissectors\n"
        "known = dissectors.load(); names = known.names(); known.resolve('NodeStatus'); known.message(0, 20900)\n"
        "heavy = {'numpy', 'pyarrow', 'dronecan', 'can', 'analyzer'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "assert not [path for path in opened if path.startswith(home)], opened\n"
        "assert any(path.endswith('.uavcan') for path in opened), 'the hook saw nothing'\n"
    )
    root = str(Path(dissectors.__file__).parents[1])
    environment = {**os.environ, "HOME": str(tmp_path), "PYTHONPATH": root}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_loading_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed = []
    monkeypatch.setattr("dissectors.namespace.dsdl.parse", lambda _, file: parsed.append(file))
    load()
    assert parsed == []


def test_what_carries_packets_is_looked_for_once(known: registry.Registry) -> None:
    first = [profile.having("packets") for profile in known.profiles]
    assert {message.table for some in first for message in some} == {"PUSHCAN", "PUSHSCI"}
    assert all(again is some for again, some in zip((p.having("packets") for p in known.profiles), first, strict=True))
