"""`dataclass` as the standard library has it, at a small part of its cost until somebody makes an instance.

The standard one compiles up to six methods of every class while its module is imported: a fifth of the time that
`check` takes to start. Here `__init__` is compiled for the first instance, and classes share the other methods. Only
what this program uses is known: slots, no parents that have fields. `fields` and `asdict` of the standard library take
such classes, too.
"""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from dataclasses import dataclass, field, replace

__all__ = ["as_dict", "dataclass", "field", "replace"]

_MISSING: Any = object()
_set = object.__setattr__


class _Options(dict[str, Any]):
    """The arguments of `field`."""


if not TYPE_CHECKING:

    def dataclass(*, slots: bool, frozen: bool = False, eq: bool = True) -> Any:
        """Return a decorator that makes a class anew, with slots for its annotated names and methods for them."""
        if not slots:
            raise TypeError("a record has slots")
        return lambda cls: _made(cls, frozen=frozen, eq=eq)

    def field(**options: Any) -> Any:
        """Return the options of a field: `default`, `default_factory`, `init`, `repr` and `compare`."""
        return _Options(options)

    def replace(record: Any, /, **changes: Any) -> Any:
        """Return a copy with other values in some fields."""
        cls = type(record)
        read = vars(cls).get("record_values") or _values(cls.__match_args__)  # one of the standard library has none
        values = dict(zip(cls.__match_args__, read.__func__(record), strict=True))
        values.update(changes)
        return cls(**values)


def as_dict(value: Any) -> Any:
    """Return a record as a dictionary by field, and so every record inside of it; all else is shared, not copied."""
    if isinstance(value, dict):
        return {name: as_dict(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        parts = [as_dict(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
    options = getattr(type(value), "record_options", None)
    return value if options is None else {name: as_dict(getattr(value, name)) for name in options}


class _StandardFields:
    """`__dataclass_fields__`, by which the standard library knows a class: made when it asks."""

    def __get__(self, _: object, owner: Any) -> dict[str, Any]:
        import dataclasses  # noqa: PLC0415 - it is large

        fields = {name: dataclasses.field(**options) for name, options in owner.record_options.items()}
        twin = type(owner.__name__, (), {"__annotations__": dict.fromkeys(fields, "Any"), **fields})
        owner.__dataclass_fields__ = vars(dataclasses.dataclass(init=False, repr=False, eq=False)(twin))[
            "__dataclass_fields__"
        ]
        for name, one in owner.__dataclass_fields__.items():
            one.type = owner.__annotations__[name]
        return dict(owner.__dataclass_fields__)


def _made(cls: type, *, frozen: bool, eq: bool) -> type:
    content = dict(vars(cls))
    options: dict[str, _Options] = {}
    for name, kind in content.get("__annotations__", {}).items():
        if not kind.startswith("ClassVar"):
            value = content.pop(name, _MISSING)
            options[name] = (
                value if isinstance(value, _Options) else _Options({} if value is _MISSING else {"default": value})
            )
    for name in ("__dict__", "__weakref__"):
        content.pop(name, None)
    content |= {
        "__slots__": tuple(options),
        "__match_args__": tuple(name for name, one in options.items() if one.get("init", True)),
        "record_values": _values([name for name, one in options.items() if one.get("init", True)]),
        "__dataclass_fields__": _StandardFields(),
        "__init__": _first_init,
        "__repr__": _repr,
        "record_options": options,
    }
    if eq:
        content["record_key"] = _values([name for name, one in options.items() if one.get("compare", True)])
        content |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
    if frozen:
        content |= {"__setattr__": _setattr, "__delattr__": _delattr}
        content |= {"__getstate__": _getstate, "__setstate__": _setstate}
    made = type(cls)(cls.__name__, cls.__bases__, content)
    made.__qualname__ = cls.__qualname__
    return made


def _values(names: Sequence[str]) -> Any:
    """Return what gives the values of some fields of an instance."""
    return staticmethod(attrgetter(*names) if len(names) > 1 else lambda self: tuple(getattr(self, n) for n in names))


def _first_init(self: Any, *args: Any, **values: Any) -> None:
    """Make the real `__init__`, and call it."""
    cls: Any = next(one for one in type(self).__mro__ if "record_options" in vars(one))
    cls.__init__ = _init(cls)
    cls.__init__(self, *args, **values)


def _init(cls: Any) -> Any:
    known: dict[str, Any] = {"_MISSING": _MISSING}
    arguments, lines = ["self"], []
    for name, one in cls.record_options.items():
        made = "default_factory" in one
        known[default := f"_default_{name}"] = one["default_factory"] if made else one.get("default")
        if not one.get("init", True):
            if not made and "default" not in one:
                continue
            value = f"{default}()" if made else default
        elif made:
            arguments.append(f"{name}=_MISSING")
            value = f"{default}() if {name} is _MISSING else {name}"
        else:
            arguments.append(f"{name}={default}" if "default" in one else name)
            value = name
        known[f"_set_{name}"] = getattr(cls, name).__set__
        lines.append(f"_set_{name}(self, {value})" if cls.__setattr__ is _setattr else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    exec(f"def __init__({', '.join(arguments)}):\n  " + "\n  ".join(lines or ["pass"]), known)  # noqa: S102 - as they do
    made_init = known["__init__"]
    made_init.__qualname__ = f"{cls.__qualname__}.__init__"
    return made_init


def _repr(self: Any) -> str:
    shown = (name for name, one in self.record_options.items() if one.get("repr", True))
    return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"


def _eq(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    return self.record_key(self) == self.record_key(other)


def _hash(self: Any) -> int:
    return hash(self.record_key(self))


def _setattr(_: Any, name: str, __: Any) -> None:
    from dataclasses import FrozenInstanceError  # noqa: PLC0415

    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _delattr(_: Any, name: str) -> None:
    from dataclasses import FrozenInstanceError  # noqa: PLC0415

    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _getstate(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.record_options]


def _setstate(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.record_options, state, strict=True):
        _set(self, name, value)
