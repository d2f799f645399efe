"""Fleets: many captures judged by a cluster, their results as tables in one store, and reports over them.

    from analyzer.fleet import ResultStore, scan

    ResultStore("results").connected().sql("select verdict, count(*) from counted group by 1")
    polars.from_arrow(scan(["a.log", "s3://logs/b.mcap"], "ESCStatus", ["t", "voltage"]))

`analyzer.fleet.tables` documents every table and column of a store.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analyzer.fleet.export import scan as scan
    from analyzer.fleet.store import ResultStore as ResultStore

__all__ = ["ResultStore", "scan"]

_HOMES = {"ResultStore": "analyzer.fleet.store", "scan": "analyzer.fleet.export"}


def __getattr__(name: str) -> Any:
    # Parts of this package are imported where the extra, and Arrow, are not needed or not there.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415

    return getattr(import_module(_HOMES[name]), name)
