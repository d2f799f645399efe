"""Data type signatures: against table 4.3.1 of the document, and against pydronecan for every public type."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import dronecan.dsdl
import pytest

from dissectors.namespace import Namespace
from dissectors.signature import crc64, normalised, signature

SPECS = Path(find_spec("dronecan").origin).parent / "dsdl_specs"
TMOTOR = Path(find_spec("dissectors").origin).parent / "tmotor"


@pytest.fixture(scope="module")
def public() -> Namespace:
    names = Namespace()
    names.add_tree(SPECS)
    return names


def test_crc_has_its_published_check_value() -> None:
    assert crc64(b"123456789") == 0x62EC59E3F1A4F00A
    assert crc64(b"456789", crc64(b"123")) == 0x62EC59E3F1A4F00A


@pytest.mark.parametrize(
    ("file", "full_name", "table_4_3_1"),
    [
        ("1030.RawCommand", "RawCommand", 0x217F5C87D7EC951D),
        ("1033.ParamCfg", "ParamCfg", 0x948F5E0B33E0EDEE),
        ("1034.ESCStatus", "Status", 0xA9AF28AEA2FBB254),
        ("1038.PUSHSCI", "PUSHSCI", 0xCE2B6D6B6BDC0AE8),
        ("1039.PUSHCAN", "PUSHCAN", 0xAACF9B4B2577BC6E),
        ("1332.ParamGet", "ParamGet", 0x462875A0ED874302),
    ],
)
def test_the_document_proves_itself(file: str, full_name: str, table_4_3_1: int) -> None:
    path = TMOTOR / f"{file}.uavcan"
    assert "OVERRIDE_SIGNATURE" not in path.read_text()
    names = Namespace()
    names.add(path, f"uavcan.equipment.esc.{full_name}")
    compiled = names.compile(f"uavcan.equipment.esc.{full_name}")
    assert compiled.signature == table_4_3_1
    assert compiled.type_id == int(file.partition(".")[0])


def test_normalised_text() -> None:
    assert normalised("a.B", [(False, [])]) == "a.B"
    assert normalised("a.B", [(False, ["void3", "saturated uint8[<=3] x"])]) == "a.B\nvoid3\nsaturated uint8[<=3] x"
    assert normalised("a.B", [(False, []), (True, ["c.D e"])]) == "a.B\n---\n@union\nc.D e"


def test_override_replaces_the_text_but_not_the_nested_types() -> None:
    assert signature("anything", [], 7) == 7
    assert signature("anything", [5], 7) == signature("else", [5], 7) != 7


def test_every_public_type_is_known(public: Namespace) -> None:
    assert len(public.entries) == 147
    assert {name.partition(".")[0] for name in public.entries} == {
        *("uavcan", "dronecan", "ardupilot", "com", "cuav", "mppt")
    }


def test_every_public_type_agrees_with_pydronecan(public: Namespace) -> None:
    """Signature, IDs, sizes, field names, constants: pydronecan's parser is the oracle."""
    oracle = dronecan.dsdl.parse_namespaces([str(path) for path in sorted(SPECS.iterdir()) if path.is_dir()])
    assert {one.full_name for one in oracle} == set(public.entries)
    for one in oracle:
        mine = public.compile(one.full_name)
        assert mine.signature == one.get_data_type_signature(), one.full_name
        assert mine.type_id == one.default_dtid
        assert mine.service == (one.kind == one.KIND_SERVICE)
        if mine.service:
            halves = [
                (one.request_fields, one.request_constants, one.request_union),
                (one.response_fields, one.response_constants, one.response_union),
            ]
            sizes = [
                (one.get_min_bitlen_request(), one.get_max_bitlen_request()),
                (one.get_min_bitlen_response(), one.get_max_bitlen_response()),
            ]
        else:
            halves = [(one.fields, one.constants, one.union)]
            sizes = [(one.get_min_bitlen(), one.get_max_bitlen())]
        assert [(layout.min_bits, layout.max_bits) for layout in mine.layouts] == sizes, one.full_name
        for layout, constants, (fields, theirs, union) in zip(mine.layouts, mine.constants, halves, strict=True):
            assert [member.name for member in layout.fields] == [field.name or "" for field in fields]
            assert constants == {constant.name: constant.value for constant in theirs}
            assert layout.union == union


def test_overridden_signatures_differ_from_the_computed_ones(public: Namespace) -> None:
    """27 public types carry OVERRIDE_SIGNATURE; a sender that leaves it out fails every CRC."""
    overridden = [name for name, entry in public.entries.items() if "OVERRIDE_SIGNATURE" in entry.path.read_text()]
    assert len(overridden) == 27
    assert public.compile("com.tmotor.esc.ParamCfg").signature == 0x948F5E0B33E0EDEE
    names = Namespace()
    names.add(TMOTOR / "1033.ParamCfg.uavcan", "com.tmotor.esc.ParamCfg")
    assert names.compile("com.tmotor.esc.ParamCfg").signature == 0x463BFAF8255DB99A
