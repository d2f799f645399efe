"""Display filters: which rows of a capture somebody wants to see. Imported only where one is given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analyzer.filter.compiled import Expression as Expression
    from analyzer.filter.compiled import Filter as Filter
    from analyzer.filter.compiled import compile_expression as compile_expression
    from analyzer.filter.compiled import compile_filter as compile_filter
    from analyzer.filter.language.errors import FilterError as FilterError

__all__ = ["Expression", "Filter", "FilterError", "compile_expression", "compile_filter"]


def __getattr__(name: str) -> Any:
    # An error can be caught, and a filter be read, without numpy and pyarrow.
    from importlib import import_module  # noqa: PLC0415

    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"analyzer.filter.{'errors' if name == 'FilterError' else 'compiled'}"), name)
