"""The results of a fleet: one Delta table each, in a folder or in any storage that Delta knows."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.fleet.listing import without_password
from analyzer.fleet.tables import FAILED, TABLES, UNAVAILABLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import duckdb

_SCHEMES = ("s3", "gs", "az", "abfs", "abfss", "adl")  # what Delta can write safely; not HTTP, not SSH
_COLOUR, _QUERY = re.compile(r"\x1b\[[\d;]*m"), re.compile(r"(?<=\S)\?\S+")
_MARK = "captures"  # written last: what it names is done
# What counts: the newest result of each address, with the rows that the same run wrote. Of equal bytes the first
# address of a vehicle is counted, others are duplicates.
_VIEWS = """
create view latest as select *, sha256 <> '' and row_number() over (partition by case when sha256 = '' then key else
    sha256 end order by vehicle = '', url) > 1 as duplicate
    from (select * from all_captures qualify row_number() over (partition by url order by at_ns desc, run desc) = 1);
create view counted as select * from latest where not duplicate;
"""


class StoreError(Exception):
    """A store that cannot be read or written; says which and why."""


class ResultStore:
    """A store at a path or an address. Secrets come from the environment only (AWS_..., GOOGLE_..., AZURE_...).

    Raises `StoreError` where its tables are of another form, and `ValueError` for an address that Delta does not know.
    """

    def __init__(self, place: str) -> None:
        without_password(place)
        scheme, found, _ = place.partition("://")
        if found and scheme not in _SCHEMES:
            raise ValueError(f"{place}: tables are written to a folder, or to {', '.join(_SCHEMES)} ://")
        self.place = place if "://" in place else os.path.abspath(place)  # noqa: PTH100 - without .. in it
        self._known: dict[str, Any] = {}  # tables as they were when we wrote them last

    @property
    def local(self) -> bool:
        """True if it is a folder."""
        return "://" not in self.place

    def table(self, name: str) -> str:
        """Return the place of a table."""
        return f"{self.place.rstrip('/')}/{name}"

    def opened(self, name: str) -> Any:
        """Return a table as `deltalake.DeltaTable`, None if there is none yet. Raises `StoreError`."""
        from deltalake import DeltaTable  # noqa: PLC0415 - of the extra
        from deltalake.exceptions import TableNotFoundError  # noqa: PLC0415

        try:
            return DeltaTable(self.table(name))
        except TableNotFoundError:
            return None
        except Exception as error:  # whatever a storage raises
            raise self._refused(name, error) from error

    def _refused(self, name: str, error: Exception) -> StoreError:
        """Return what a storage has raised, in one line without colours; what stands behind ? may be a key."""
        said = [" ".join(line.split()).lstrip("↳ ") for line in _COLOUR.sub("", str(error)).splitlines()]
        return StoreError(f"{self.table(name)}: {_QUERY.sub('', ': '.join(filter(None, said)))}")

    def append(self, rows: Mapping[str, Sequence[pa.Table]]) -> bool:
        """Write rows of several captures, `captures` after all others; return whether somebody else did since we did.

        Raises `StoreError`.
        """
        others = False
        for name in sorted(rows, key=lambda one: one == _MARK):
            if rows[name]:
                others = self._write(name, pa.concat_tables(rows[name]).cast(TABLES[name])) and name == _MARK
        return others

    def _write(self, name: str, rows: pa.Table) -> bool:
        from deltalake import write_deltalake  # noqa: PLC0415 - of the extra

        known = self._known.get(name)
        table = known or self.opened(name)
        version = None if known is None else known.version()
        try:
            write_deltalake(table or self.table(name), rows, mode="append")
            self._known[name] = table = table or self.opened(name)
        except Exception as error:  # whatever a storage raises
            raise self._refused(name, error) from error
        return version is not None and table.version() > version + 1

    def done(self, *, retry: bool) -> set[str]:
        """Return the keys that need not be done again; with `retry` those that failed are not among them."""
        found = self.opened(_MARK)
        if found is None:
            return set()
        table = found.to_pyarrow_table(columns=["key", "outcome", "at_ns"]).sort_by("at_ns")
        last = dict(zip(table["key"].to_pylist(), table["outcome"].to_pylist(), strict=True))
        again = (UNAVAILABLE, *FAILED) if retry else (UNAVAILABLE,)
        return {key for key, outcome in last.items() if outcome not in again}

    def connected(self) -> duckdb.DuckDBPyConnection:
        """Return DuckDB with every table under its name, of what counts, `latest` and `counted` captures among them.

        Raises `StoreError` if nothing has been written yet.
        """
        import duckdb  # noqa: PLC0415 - of the extra

        if self.opened(_MARK) is None and self.opened("runs") is None:
            raise StoreError(f"{self.place}: no fleet has been checked into it")
        answers = duckdb.connect()
        for name, schema in TABLES.items():
            answers.register(f"all_{name}", self._rows(name, schema))
        answers.execute(_VIEWS)
        for name in TABLES:
            if name == "runs":
                answers.execute("create view runs as select distinct * from all_runs")
            elif name != _MARK:
                answers.execute(
                    f"create view {name} as select r.* from all_{name} r join counted using (key, run)"  # noqa: S608
                )
        answers.execute("create view captures as select * from latest")
        return answers

    def _rows(self, name: str, schema: pa.Schema) -> Any:
        found = self.opened(name)
        if found is None:
            return schema.empty_table()
        rows = found.to_pyarrow_dataset()
        if missing := set(schema.names) - set(rows.schema.names):
            raise StoreError(f"{self.table(name)}: it lacks {', '.join(sorted(missing))}: another version wrote it")
        return rows

    def compact(self) -> dict[str, int]:
        """Put small files together; return how many each table has afterwards. Raises `StoreError`."""
        left = {}
        for name in TABLES:
            found = self.opened(name)
            if found is not None:
                try:
                    found.optimize.compact()
                    left[name] = len(found.file_uris())
                except Exception as error:  # whatever a storage raises
                    raise self._refused(name, error) from error
        return left

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Be the only driver that writes it, as long as this lasts: a folder is locked, and is free when a driver dies.

        In other storages Delta's own commits keep two drivers apart; both would do the same work, and it counts once.
        Raises `StoreError`.
        """
        if not self.local:
            yield
            return
        try:
            os.makedirs(self.place, exist_ok=True)  # noqa: PTH103 - any name
            file = (Path(self.place) / ".driver").open("w", encoding="ascii")
        except OSError as error:
            raise StoreError(f"{self.place}: {error.strerror or error}") from None
        with file:
            _lock(file.fileno(), self.place)
            yield


def _lock(number: int, place: str) -> None:
    try:
        import fcntl  # noqa: PLC0415 - not on every system
    except ImportError:
        return
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise StoreError(f"{place}: another run is writing it") from None
