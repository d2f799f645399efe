"""DSDL v0 as a language: what is taken, what is refused and with which words, and that nothing else ever raises."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import dsdl
from dissectors.dsdl import Constant, DsdlError
from dissectors.layout import ArrayType, CompoundType, Member, PrimitiveType, plan, wire_bits
from dissectors.namespace import MAX_DEPTH, Namespace

SPECS = Path(find_spec("dronecan").origin).parent / "dsdl_specs"
UINT8 = PrimitiveType("uint", 8)


def tree(folder: Path, **files: str) -> Namespace:
    """A namespace `acme` of definition files, written as Name="text" or n20000_Name="text"."""
    (folder / "acme").mkdir()
    for name, text in files.items():
        number, _, short = name.rpartition("_")
        stem = f"{number[1:]}.{short}" if number else short
        (folder / "acme" / f"{stem}.uavcan").write_bytes(text.encode())
    namespace = Namespace()
    namespace.add_tree(folder)
    return namespace


def fields(text: str) -> list[tuple[str, object, object]]:
    (section,) = dsdl.parse(text, "x").sections
    return [(field.name, field.base, field.size and (field.size.count, field.size.dynamic)) for field in section.fields]


@pytest.mark.parametrize(
    ("word", "kind", "bits", "saturated"),
    [
        *((f"uint{bits}", "uint", bits, True) for bits in range(2, 65)),
        *((f"int{bits}", "int", bits, True) for bits in range(2, 65)),
        *((f"float{bits}", "float", bits, True) for bits in (16, 32, 64)),
        ("bool", "bool", 1, True),
        ("truncated uint7", "uint", 7, False),
        ("truncated float16", "float", 16, False),
        ("saturated int18", "int", 18, True),
    ],
)
def test_every_primitive_and_cast_mode(word: str, kind: str, bits: int, saturated: bool) -> None:
    assert fields(f"{word} a") == [("a", PrimitiveType(kind, bits, saturated), None)]


def test_padding_has_no_name() -> None:
    assert fields("\n".join(f"void{bits}" for bits in range(1, 65))) == [
        ("", PrimitiveType("void", bits), None) for bits in range(1, 65)
    ]


def test_arrays_and_nested_names() -> None:
    text = "uint8[3] a\nuint8[<=4] b\nuint8[<4] c\nacme.deep.Thing d\nThing[0x10] e\ntruncated uint5 [ <= 2 ] f"
    assert fields(text) == [
        ("a", UINT8, (3, False)),
        ("b", UINT8, (4, True)),
        ("c", UINT8, (3, True)),
        ("d", "acme.deep.Thing", None),
        ("e", "Thing", (16, False)),
        ("f", PrimitiveType("uint", 5, saturated=False), (2, True)),
    ]


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("bool A = true", True),
        ("bool A = 0", False),
        ("uint8 A = 255", 255),
        ("int8 A = -128", -128),
        ("uint40 A = 0xACCE551B1E", 0xACCE551B1E),
        ("uint4 A = 0b1010", 10),
        ("uint8 A = 010", 10),
        ("float16 A = -65504", -65504.0),
        ("float32 A = 4.7746482927568605", 4.7746482927568605),
        ("float32 A = 1e3", 1000.0),
        ("uint16 A = 1.5e3", 1500),
        ("uint8 A = '/'", 47),
        ("uint8 A = '#'  # a hash inside quotes is no comment", 35),
        (r"uint8 A = '\n'", 10),
        (r"uint8 A = '\x41'", 65),
        (r"uint8 A = '\''", 39),
    ],
)
def test_constants_keep_their_value_and_take_no_space(line: str, value: float) -> None:
    (section,) = dsdl.parse(line, "x").sections
    (constant,) = section.constants
    assert isinstance(constant, Constant)
    assert (constant.value, type(constant.value)) == (value, type(value))
    assert section.fields == ()


def test_services_directives_comments_and_line_ends() -> None:
    tree = dsdl.parse("# c\r\n@union  # tag\r\nuint8 a\rint8 b\n--- # mark\r\nOVERRIDE_SIGNATURE 0x0F\nbool a", "x")
    assert tree.service
    assert tree.override == 15
    assert [section.union for section in tree.sections] == [True, False]
    assert [[field.name for field in section.fields] for section in tree.sections] == [["a", "b"], ["a"]]


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("uint8 a\nuint1 b", 2, "one bit is a bool"),
        ("uint65 a", 1, "2 to 64 bits"),
        ("void65", 1, "1 to 64 bits"),
        ("void0", 1, "1 to 64 bits"),
        ("float24 a", 1, "float16, float32, float64"),
        ("double a", 1, "no such type"),
        ("saturated void3", 1, "padding"),
        ("truncated Thing a", 1, "nested type"),
        ("truncated", 1, "a type is expected"),
        ("void3 a", 1, "padding has no name"),
        ("void3[2] a", 1, "array of padding"),
        ("uint8 1a", 1, "not understood"),
        ("uint8 _a", 1, "a name is expected"),
        ("uint8 a.b", 1, "a name is expected"),
        ("uint8", 1, "a name is expected"),
        ("uint8 a b", 1, "nothing may follow"),
        ("uint8 a\n\nint8 a", 3, "a is defined twice"),
        ("uint8 a\nuint8 a = 1", 2, "a is defined twice"),
        ("uint8[0] a", 1, "1 to 65535"),
        ("uint8[<1] a", 1, "1 to 65535"),
        ("uint8[65536] a", 1, "1 to 65535"),
        ("uint8[<=] a", 1, "[N]"),
        ("uint8[2][2] a", 1, "array of arrays"),
        ("uint8 A = 256", 1, "does not fit: 0 to 255"),
        ("int8 A = -129", 1, "-128 to 127"),
        ("bool A = 2", 1, "does not fit"),
        ("uint8 A = 1.5", 1, "whole number"),
        ("float16 A = 1e9", 1, "float16"),
        ("float64 A = 1e999", 1, "float64"),
        ("uint8 A = 1e999", 1, "whole number"),
        ("uint8 A = 2 + 2", 1, "not understood"),
        ("uint8 A = B", 1, "one literal"),
        ("uint8 A =", 1, "a value is expected"),
        ("uint64 A = " + "9" * 81, 1, "80 digits"),
        ("Thing A = 1", 1, "constant"),
        ("uint8[2] A = 1", 1, "constant"),
        ("uint8 A = 'ab'", 1, "not understood"),
        ("@union\nuint8 a", 2, "at least two"),
        ("@union\nuint8 a\nvoid2", 3, "no padding"),
        ("@union\n@union", 2, "second @union"),
        ("@sealed", 1, "unknown directive @sealed (allowed: @union)"),
        ("@union uint8", 1, "nothing may follow"),
        ("---\n---", 2, "second response mark"),
        ("OVERRIDE_SIGNATURE", 1, "hexadecimal"),
        ("OVERRIDE_SIGNATURE 0x11112222333344445", 1, "hexadecimal"),
        ("OVERRIDE_SIGNATURE 1\nOVERRIDE_SIGNATURE 1", 2, "second OVERRIDE"),
        ("uint8 \u00fc", 1, "not understood"),
    ],
)
def test_errors_say_file_line_and_reason(text: str, line: int, reason: str) -> None:
    with pytest.raises(DsdlError) as caught:
        dsdl.parse(text, "acme/Thing.uavcan")
    assert (caught.value.file, caught.value.line) == ("acme/Thing.uavcan", line)
    assert reason in caught.value.reason
    assert str(caught.value) == f"acme/Thing.uavcan:{line}: {caught.value.reason}"


def parse_or_line(text: str) -> int:
    """The line of the error, 0 if the text is a definition."""
    try:
        assert len(dsdl.parse(text, "x").sections) in (1, 2)
    except DsdlError as error:
        return error.line
    return 0


@given(st.text())
def test_arbitrary_text_gives_a_definition_or_a_dsdl_error(text: str) -> None:
    assert 0 <= parse_or_line(text) <= len(text) + 1


@given(st.data())
def test_damaged_definitions_give_a_definition_or_a_dsdl_error(data: st.DataObject) -> None:
    path = data.draw(st.sampled_from(sorted(SPECS.rglob("*.uavcan"))))
    text = dsdl.read(path)
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = data.draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + data.draw(st.text("[]<=0x9.-' \n#@aVuint8 \\\u00e9e+", max_size=8)) + text[stop:]
    assert 0 <= parse_or_line(text) <= len(text) + 1


def test_nested_types_resolve_in_the_same_namespace_or_by_full_name(tmp_path: Path) -> None:
    names = tree(tmp_path, Inner="uint5 a\nbool b", n20000_Outer="Inner x\nvoid2\nacme.Inner[<=3] y")
    outer = names.compile("acme.Outer")
    inner = CompoundType("acme.Inner", (Member("a", PrimitiveType("uint", 5)), Member("b", PrimitiveType("bool", 1))))
    assert outer.type_id == 20000
    assert outer.layouts == (
        CompoundType(
            "acme.Outer",
            (Member("x", inner), Member("", PrimitiveType("void", 2)), Member("y", ArrayType(inner, 3, dynamic=True))),
        ),
    )
    assert plan(outer.layouts[0]) == [
        ("struct", 3, 0),
        *(("struct", 2, 0), ("uint", 5, 0), ("bool", 1, 0)),
        ("void", 2, 0),
        *(("list", 3, 2), ("struct", 2, 0), ("uint", 5, 0), ("bool", 1, 0)),
    ]


def test_plan_of_a_union_and_a_static_array(tmp_path: Path) -> None:
    names = tree(tmp_path, U="@union\nuint8[2] a\nfloat16 b\nint3 c")
    (layout,) = names.compile("acme.U").layouts
    assert layout.tag_bits == 2
    assert (layout.min_bits, layout.max_bits) == (5, 18)
    assert plan(layout) == [("union", 3, 2), ("array", 2, 0), ("uint", 8, 0), ("float", 16, 0), ("int", 3, 0)]


def test_halves_of_a_service_have_constants_of_their_own(tmp_path: Path) -> None:
    service = tree(tmp_path, n20_Ask="uint8 A = 1\nuint8 a\n---\nuint8 A = 2").compile("acme.Ask")
    assert service.service
    assert service.constants == ({"A": 1}, {"A": 2})
    assert [layout.name for layout in service.layouts] == ["acme.Ask.Request", "acme.Ask.Response"]


@pytest.mark.parametrize(
    ("layout", "classic", "fd"),
    [
        (ArrayType(UINT8, 255, dynamic=True), (0, 2040), (8, 2048)),
        (ArrayType(PrimitiveType("uint", 7), 3, dynamic=True), (2, 23), (2, 23)),
        (
            ArrayType(CompoundType("x.Y", (Member("a", ArrayType(UINT8, 3, dynamic=True)),)), 2, dynamic=False),
            (2, 50),
            (4, 52),
        ),
        (CompoundType("x.Z", (Member("a", ArrayType(UINT8, 3, dynamic=True)), Member("b", UINT8))), (10, 34), (10, 34)),
    ],
)
def test_only_the_tail_array_loses_its_length(layout: ArrayType | CompoundType, classic: tuple, fd: tuple) -> None:
    assert wire_bits(layout, tail=True) == classic
    assert wire_bits(layout, tail=False) == fd


@pytest.mark.parametrize(
    ("files", "name", "file_line", "reason"),
    [
        ({"A": "uint8 a\nA b"}, "A", "A:2", "contains itself"),
        ({"A": "B b", "B": "\nA a"}, "A", "B:2", "acme.A contains itself"),
        ({"A": "Gone b"}, "A", "A:1", "no definition file for acme.Gone"),
        ({"A": "else.Gone b"}, "A", "A:1", "no definition file for else.Gone"),
        ({"A": "S s", "n1_S": "---"}, "A", "A:1", "is a service"),
        ({"n256_S": "---"}, "S", "256.S:0", "at most 255"),
        ({"n65536_M": "uint8 a"}, "M", "65536.M:0", "at most 65535"),
        ({"M": "uint64[65535] a"}, "M", "M:0", "too large"),
        ({"M": "\n".join(f"uint8 a{n}" for n in range(3000))}, "M", "M:0", "too large"),
        ({"M": "#" * (dsdl.MAX_FILE_BYTES + 1)}, "M", "M:0", "larger than"),
    ],
)
def test_compile_errors(tmp_path: Path, files: dict, name: str, file_line: str, reason: str) -> None:
    names = tree(tmp_path, **files)
    for _ in range(2):  # a failure leaves nothing behind that changes the second answer
        with pytest.raises(DsdlError, match=r"\.uavcan") as caught:
            names.compile(f"acme.{name}")
        assert f"{Path(caught.value.file).stem}:{caught.value.line}" == file_line
        assert reason in caught.value.reason


def test_nesting_is_bounded(tmp_path: Path) -> None:
    chain = {f"T{depth}": f"T{depth + 1} a" for depth in range(MAX_DEPTH + 2)}
    with pytest.raises(DsdlError, match="nested deeper"):
        tree(tmp_path, **chain).compile("acme.T0")


def test_repeated_nesting_cannot_explode(tmp_path: Path) -> None:
    bomb = {f"T{depth}": "\n".join(f"T{depth + 1} a{n}" for n in range(10)) for depth in range(MAX_DEPTH - 2)}
    with pytest.raises(DsdlError, match="too large"):
        tree(tmp_path, **bomb, **{f"T{MAX_DEPTH - 2}": "uint8 a"}).compile("acme.T0")


def test_file_names_that_define_nothing_are_refused(tmp_path: Path) -> None:
    for bad in ("lower.uavcan", "x.Name.uavcan", "1.2.3.4.Name.uavcan"):
        folder = tmp_path / bad.replace(".", "_")
        folder.mkdir()
        (folder / "acme").mkdir()
        (folder / "acme" / bad).touch()
        with pytest.raises(DsdlError, match="is called"):
            Namespace().add_tree(folder)


@pytest.mark.parametrize(
    "name", ["Thing", "Acme.Thing", "acme.thing", "acme.\u00c9", "acme..Thing", "a." * 40 + "Thing"]
)
def test_illegal_type_names_are_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "Thing.uavcan").touch()
    with pytest.raises(DsdlError, match="no type name"):
        Namespace().add(tmp_path / "Thing.uavcan", name)


def test_two_files_for_one_type_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DsdlError, match="also defined by"):
        tree(tmp_path, A="uint8 a", n20000_A="uint8 a")
