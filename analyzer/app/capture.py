"""A capture as Python sees it: batches of Arrow tables, or one whole table by name."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.app.criteria import Criteria
from analyzer.app.found import FoundTable
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.app.schemas import ChosenTables
from analyzer.decode.by_name import example, find_table
from analyzer.devices.escs import Escs
from analyzer.facts.dialects import checked
from analyzer.sources.merge import Plan
from analyzer.sources.origin import given
from analyzer.tables import ESC, FRAMES
from analyzer.window.part import narrowed
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    from analyzer.app.source import RunSource
    from analyzer.decode.core import Totals
    from analyzer.decode.engine import Batch, Engine
    from analyzer.sources import CaptureError
    from analyzer.sources.origin import Origin
    from dissectors import Registry


class Capture:
    """A capture, decoded on the way through. Iterating gives `Batch` after `Batch`; each iteration reads it anew.

    Args:
        origins: paths of files of any format, packed or not, or binary file objects with a name, merged by time; `-` is
            standard input.
        plan: names of buses and shifts of clocks.
        dissectors: folders with further data types, before the built-in ones.
        dialects: readings of doubtful fields by node ID, against the node's own data.
        filter: a display filter: tables and batches hold what it selects.
        tables: the tables of messages and packets that batches hold: no other is decoded.
        columns: the columns that these have, those among them that are asked for.

    Raises:
        FilterError: the filter is wrong.
        CaptureError: a file cannot be read. Damage behind readable content is in `damage` instead.
        UnavailableError: a `CaptureError` of a file that could not be read now: missing, not permitted, network.
        MergeError: the captures have no clock in common.
        ValueError: no field has such a reading.

    One of paths can be pickled; what comes back has not been read.
    """

    def __init__(
        self, origins: Sequence[Origin], plan: Plan | None = None, dissectors_: Sequence[Path] = (),
        dialects: Mapping[int, Collection[str]] | None = None,
        filter: str | None = None,  # noqa: A002 - what everybody calls it
        tables: Collection[str] | None = None, columns: Collection[str] | None = None,
    ) -> None:  # fmt: skip
        self._made_of = origins, plan, dissectors_, dialects, filter, tables, columns
        rules = RuleChoice(dialects=tuple((node, one) for node, some in (dialects or {}).items() for one in some))
        request = Request(tuple(map(given, origins)), plan or Plan(), tuple(dissectors_), rules=rules, filter=filter)
        self._run = Run(request)
        self._chosen = ChosenTables(self._run.registry, tables, columns)
        if filter is not None:
            from analyzer.filter.compiled import compile_filter  # noqa: PLC0415 - few captures have one

            compile_filter(filter, self._run.registry)
        checked(dialects or {}, self._run.registry)
        self._read = False

    def __reduce__(self) -> tuple[type[Capture], tuple[Any, ...]]:
        """Pickle what it is made of, not what was read. Raises `TypeError` for file objects that cannot be pickled."""
        return type(self), self._made_of

    def __iter__(self) -> Iterator[Batch]:
        """Yield batches in capture order."""
        yield from map(self._chosen.of, map(narrowed, self._marked(self._chosen.tables)))

    def _marked(self, tables: Collection[str] | None = None) -> Iterator[Batch]:
        """Yield the batches whole, with marks on what a filter selects; of messages with these tables, None for all."""
        run = self._next_run()
        run.unpack_only(tables)
        if run.request.filter is None:
            yield from run.batches()
            return
        from analyzer.app.filtered.frames import matching_frames  # noqa: PLC0415 - few captures have a filter

        matching = matching_frames(run)
        if matching is not None:
            yield from matching.mark(run.batches())

    def filter(self, text: str) -> Capture:
        """Return another capture of the same files that holds what a display filter selects. Raises `FilterError`.

        That is, the transfers and their messages, their frames, and frames without a transfer. Rows keep their numbers:
        those of a batch are not without gaps any more. The files are read twice.
        """
        origins, plan, dissectors_, dialects, before, *chosen = self._made_of
        both = text if before is None else f"({before}) && ({text})"
        return type(self)(origins, plan, dissectors_, dialects, both, *chosen)

    @property
    def request(self) -> Request:
        """The request with which it was opened."""
        return self._run.request

    @property
    def registry(self) -> Registry:
        """The types."""
        return self._run.registry

    @property
    def source(self) -> RunSource:
        """The captures as they are read."""
        return self._run.source

    @property
    def engine(self) -> Engine:
        """The pipeline of the last reading."""
        return self._run.engine

    def table(self, name: str) -> pa.Table:
        """Return one table: `frames`, `transfers`, `events`, a message type or a packet (`PUSHCAN.MotorStatus`).

        `findings` are those of `findings()`; `esc` is what ESCs report beside what they were commanded. Verdicts of
        frames are the final ones. A type that does not occur gives its columns without rows. Raises `LookupError`, with
        near names, for a name that no type has, and `CaptureError`.
        """
        if name == "findings":
            return self.findings()
        if name == "esc":
            escs = Escs(self.registry)
            return pa.Table.from_batches([_chosen(escs.feed(batch), batch) for batch in self._marked()], ESC)
        if name == "frames":
            return self._frames()
        if name in ("transfers", "events"):
            return pa.Table.from_batches([getattr(narrowed(batch), name) for batch in self._marked(())])
        message, wanted = find_table(self.registry, name)
        batches = map(narrowed, self._marked([wanted]))
        pieces = [self._chosen.cut(batch.messages[wanted]) for batch in batches if wanted in batch.messages]
        return pa.Table.from_batches(pieces or [self._chosen.cut(example(self.registry, message)[wanted].slice(0, 0))])

    def _frames(self) -> pa.Table:
        run = self._next_run()
        run.unpack_only(())
        if run.request.filter is None:
            return _settled(list(run.batches()))
        from analyzer.app.filtered.frames import matching_frames  # noqa: PLC0415 - few captures have a filter

        matching, table = matching_frames(run), _settled(list(run.batches()))
        return table if matching is None else table.filter(pa.array(matching.holds(np.arange(len(table)))))

    def findings(
        self,
        *,
        select: Iterable[str] = (),
        ignore: Iterable[str] = (),
        origins: Iterable[str] = (),
        bit_rate: int | None = None,
        vehicle: str | PathLike[str] | None = None,
    ) -> pa.Table:
        """Judge the whole capture; return what is found as a table (`analyzer.tables.FINDINGS`), the worst first.

        With a filter these are the findings that name a frame of what it selects.

        The arguments are those of `analyzer.check`. Raises what that and reading a table raise.
        """
        of = None if vehicle is None else fspath(vehicle)
        chosen = RuleChoice(tuple(select), tuple(ignore), tuple(origins), bit_rate=bit_rate, vehicle=of)
        run = self._next_run()
        matching = None
        if run.request.filter is not None:
            from analyzer.app.filtered.frames import matching_frames  # noqa: PLC0415 - few captures have a filter

            matching = matching_frames(run)
        with closing(FoundTable(run, Criteria(chosen, self.registry), chosen=matching)) as found:
            for _ in found.beside(run.batches()):
                pass
            return pa.Table.from_batches([found.rows()])

    def stats(self, name: str, *, bit_rate: int | None = None) -> pa.Table:
        """Read the capture for one statistic and return its table, the main one if it has several.

        Args:
            name: as `tailbyte stats` takes it: `talkers`, `load`, `io,100ms,node == 12` ...
            bit_rate: of the bus, 1 Mbit/s if not given.

        Raises `ValueError` for what makes no sense, and `CaptureError`.
        """
        return next(reversed(self.statistics([name], bit_rate=bit_rate).values()))

    def statistics(self, names: Iterable[str], *, bit_rate: int | None = None) -> dict[str, pa.Table]:
        """Read the capture once for several statistics and return all their tables by name; as `stats`.

        Of two tables with one name, such as two of `values`, the later ones are called `values 2` and so on.
        """
        from analyzer.app.statistics import RunStatistics  # noqa: PLC0415 - few captures are read for them
        from analyzer.views.stats.machine import arrow  # noqa: PLC0415

        run = self._next_run()
        statistics = RunStatistics(run, list(names), bit_rate)
        statistics.read()
        found: dict[str, pa.Table] = {}
        for table in statistics.tables():
            often = sum(name.partition(" ")[0] == table.name for name in found)
            found[f"{table.name} {often + 1}" if often else table.name] = arrow(table)
        return found

    def _next_run(self) -> Run:
        """Return the run, which has not been read: the first one, or another over the same captures."""
        if self._read:
            self._run = self._run.renewed()
        self._read = True
        return self._run

    @property
    def damage(self) -> CaptureError | None:
        """The error that ended the last reading early."""
        return self._run.source.damage

    @property
    def totals(self) -> Totals:
        """The sums of every line and frame read so far."""
        return self._run.engine.totals

    @property
    def buses(self) -> tuple[str, ...]:
        """Interface names by the index in the `bus` columns."""
        return self._run.engine.buses


def open_capture(
    path: Origin | Sequence[Origin],
    dissectors: Sequence[Path] = (),
    *,
    buses: Mapping[str, str] | None = None,
    offsets: Mapping[str, int] | None = None,
    same_bus: bool = False,
    dialects: Mapping[int, Collection[str]] | None = None,
    filter: str | None = None,  # noqa: A002 - what everybody calls it
    tables: Collection[str] | None = None,
    columns: Collection[str] | None = None,
) -> Capture:
    """Open a capture, or several as one; nothing is read before the first batch or table is asked for.

    A capture is a path or a binary file object with a name. Objects stay open; one that cannot seek is read only once.
    `buses` gives names: of a capture, of an interface, or of `capture:interface`. `offsets` shifts the clocks of
    captures, in nanoseconds. With `same_bus` all of them recorded one bus, and what repeats is left out. `dialects`
    says how doubtful fields of nodes are read, against their own data: `{24: ["tm", "K"]}`. With a `filter` it holds
    what that selects: see `Capture.filter`. `tables` are the messages and packets that its batches hold, and nothing
    else is decoded; `columns` are those of them that are kept. Raises `LookupError` for one that there is not.
    """
    origins = list(path) if isinstance(path, Sequence) and not isinstance(path, str) else [path]
    return Capture(
        origins, Plan(dict(buses or {}), dict(offsets or {}), same_bus), dissectors, dialects, filter, tables, columns
    )


def _chosen(rows: pa.RecordBatch, batch: Batch) -> pa.RecordBatch:
    """Return the rows about transfers that are marked, all if none are."""
    if batch.selected is None or not len(rows):
        return rows
    of = (numbers(rows.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
    return rows.filter(pa.array(batch.selected.transfers[of]))


def _settled(batches: list[Batch]) -> pa.Table:
    """Return the frames, with the verdicts that were found out later."""
    table = pa.Table.from_batches([batch.frames for batch in batches])
    late = pa.Table.from_batches([batch.settled for batch in batches]).combine_chunks()
    if not len(late):
        return table
    rows = late.column("frame").to_numpy()
    for name in ("verdict", "anomaly"):
        values = table.column(name).to_numpy().copy()
        found = late.column(name).to_numpy()
        values[rows] = found if name == "verdict" else values[rows] | found
        at = FRAMES.get_field_index(name)
        table = table.set_column(at, FRAMES.field(at), pa.array(values))
    return table
