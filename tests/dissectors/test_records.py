"""Records are what the standard library makes of the same classes."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from typing import Any, ClassVar, NamedTuple

import pytest

from dissectors import records
from dissectors.records import dataclass, field, replace
from dissectors.schema import Derived, Note


@dataclass(frozen=True, slots=True)
class Frozen:
    """One with everything."""

    a: int
    b: str = "b"
    c: list[int] = field(default_factory=list)
    secret: int = field(default=3, repr=False, compare=False)
    later: int = field(init=False, compare=False)
    CONSTANT: ClassVar[int] = 5

    def __post_init__(self) -> None:
        object.__setattr__(self, "later", self.a + 1)

    @property
    def twice(self) -> int:
        return 2 * self.a


@dataclass(slots=True)
class Open:
    """One that changes."""

    a: int = 1
    kept: dict[str, int] = field(init=False, default_factory=dict)


@dataclass(slots=True, eq=False)
class Alone:
    """One that is equal only to itself."""

    a: int


class Point(NamedTuple):
    x: int
    y: Any


@dataclass(frozen=True, slots=True)
class Single:
    """One field, compared as one of several would be."""

    a: Any


def test_what_instances_are() -> None:
    one = Frozen(1, c=[2])
    assert (one.a, one.b, one.c, one.secret, one.later, one.twice, one.CONSTANT) == (1, "b", [2], 3, 2, 2, 5)
    assert repr(one) == "Frozen(a=1, b='b', c=[2], later=2)"
    assert one == Frozen(1, "b", [2], 4) != Frozen(2)
    assert one != (1, "b", [2])
    assert Frozen(1).c is not Frozen(1).c
    assert not hasattr(one, "__dict__")
    assert hash(Single(1)) == hash(Single(1))
    assert Single(float("nan")) != Single(1)
    assert Alone(1) != Alone(1)
    assert len({Alone(1), Alone(1)}) == 2
    assert Open().kept == {}
    with pytest.raises(TypeError, match="unhashable"):
        hash(Open())


@pytest.mark.parametrize(("args", "wrong"), [((), "'a'"), ((1, 2, 3, 4, 5), "takes from 2 to 5 positional arguments")])
def test_wrong_arguments_are_told_as_usual(args: tuple[int, ...], wrong: str) -> None:
    with pytest.raises(TypeError, match=rf"Frozen.__init__\(\) .*{wrong}"):
        Frozen(*args)


def test_what_is_frozen_stays() -> None:
    one = Frozen(1)
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'a'"):
        one.a = 2
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'a'"):
        del one.a
    changed = Open(2)
    changed.a = 3
    assert changed == Open(3)


def test_copies() -> None:
    one = Frozen(1, c=[2])
    for twin in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one), copy.copy(one), replace(one)):
        assert (twin, twin.later) == (one, 2)
    assert replace(one, a=5) == dataclasses.replace(one, a=5) == Frozen(5, c=[2])
    assert replace(one, a=5).later == 6
    assert copy.deepcopy(Open(4)) == Open(4)


def test_the_standard_library_knows_them() -> None:
    assert dataclasses.is_dataclass(Frozen)
    assert [(one.name, one.type, one.init) for one in dataclasses.fields(Open)] == [
        ("a", "int", True), ("kept", "dict[str, int]", False),
    ]  # fmt: skip
    assert dataclasses.asdict(Single(Frozen(1, c=[2]))) == {
        "a": {"a": 1, "b": "b", "c": [2], "secret": 3, "later": 2},
    }
    inside = {"x": [Frozen(1, c=[2])], "y": (1, Point(3, Frozen(4)))}
    assert records.as_dict(Single(inside)) == dataclasses.asdict(Single(inside))
    assert isinstance(records.as_dict(inside)["y"][1], Point)
    match Frozen(1):
        case Frozen(a, b):
            assert (a, b) == (1, "b")


def test_records_of_this_program_are_as_the_standard_library_makes_them() -> None:
    for record, values in ((Note, {"name": "x"}), (Derived, {"name": "y", "source": "z"})):
        made = record(**values)
        annotations = dict.fromkeys(record.__annotations__, "Any")
        namespace = {"__annotations__": annotations} | {
            name: dataclasses.field(**options) for name, options in record.record_options.items()
        }
        standard = dataclasses.dataclass(frozen=True)(type(record.__name__, (), namespace))
        assert repr(standard(**values)) == repr(made)
        assert list(inspect.signature(standard).parameters) == list(inspect.signature(record).parameters)


def test_a_record_has_slots() -> None:
    with pytest.raises(TypeError, match="has slots"):
        records.dataclass(slots=False)


def test_records_of_the_standard_library_are_replaced_too() -> None:
    for names in (["a"], ["a", "b"]):
        standard = dataclasses.make_dataclass("Standard", [(name, int) for name in names], frozen=True)
        assert replace(standard(*range(len(names))), a=7) == standard(7, *range(1, len(names)))
