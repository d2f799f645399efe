"""The state of a browser without its terminal: which rows are listed, where one is, what is selected of a row."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.browser.chosen import AllRows, ChosenRows
from analyzer.browser.colouring import RowColouring
from analyzer.browser.details import DetailLine, detail_lines, event_lines, frame_lines, with_transfer_id
from analyzer.browser.dump import DumpFrame, dump
from analyzer.browser.elements import with_elements
from analyzer.browser.listed import ListPages
from analyzer.browser.sorted_rows import MOST_SORTED, SortedRows
from analyzer.browser.store.cut import StoredFrames, cut_transfers
from analyzer.browser.store.order import EVENT, TRANSFER
from analyzer.facts.frame_marks import MarkBook
from analyzer.filter.compiled import compile_filter
from analyzer.filter.language.errors import FilterError
from analyzer.tables import KINDS
from analyzer.views.details.tree import Tree
from analyzer.views.terminal import escape
from analyzer.window.numbering import Numbering

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.chosen import OrderedRows
    from analyzer.browser.store.store import ListRow
    from analyzer.browser.supply import Supply
    from analyzer.decode.engine import Batch
    from analyzer.facts.frame_marks import Mark
    from analyzer.filter.matcher import Matcher
    from analyzer.views.colours.rules import ColourRule

_MOST_FRAMES = 512  # of a transfer that are shown in bytes
MOST_NAMED = 5000  # rows that a filter names one by one: it has to fit into a command line


class ShownRow(NamedTuple):
    """A row in full: its details, its frames, and as a batch of one transfer if it is one."""

    row: ListRow
    lines: list[DetailLine]
    frames: list[DumpFrame]
    batch: Batch | None


class BrowserView:
    """The state of the browser: the rows that are looked at.

    Args:
        supply: decodes and judges.
        colours: colour rules, the first that holds wins.
        marks: of the capture; they are forgotten at the end if not given.
    """

    def __init__(self, supply: Supply, colours: Sequence[ColourRule] = (), marks: MarkBook | None = None) -> None:
        self.supply, self.store = supply, supply.store
        self.numbering = Numbering()
        self.frames = StoredFrames(self.store)
        self.pages = ListPages(
            self.store, supply.registry, self.numbering, RowColouring(self.store, colours), supply.labels
        )
        self.rows: OrderedRows = AllRows(self.store)
        self.filter = ""
        self.marks = marks or MarkBook(None)
        self.anchor: tuple[int, int] | None = None  # the row that one is at
        self.begun: tuple[int, int] | None = None  # the row at which a selection of several began
        self._tree: tuple[object, Tree] | None = None

    # ---- rows

    def apply(self, text: str) -> None:
        """Show only rows that a filter selects, all for an empty one. Raises `FilterError`."""
        text = text.strip()
        rows: OrderedRows = AllRows(self.store)
        if text:
            asks = compile_filter(text, self.supply.registry).asks_findings
            rows = ChosenRows(
                self.store, lambda: self.matcher(text), lambda: self.supply.loaded,
                (lambda: self.supply.revision) if asks else (lambda: 0),
            )  # fmt: skip
            rows.start()
        self._leave(self.rows)
        if isinstance(self.rows, SortedRows):
            self._leave(self.rows.base)
        self.rows, self.filter, self.begun = rows, text, None

    def sort(self, name: str, *, falling: bool = False) -> None:
        """Sort what is listed by a field, or not any more for an empty one.

        Raises `FilterError` for what is no number, `ValueError` for more rows than are sorted.
        """
        base = self.rows.base if isinstance(self.rows, SortedRows) else self.rows
        rows = base
        if name:
            if len(base) > MOST_SORTED:
                raise ValueError(f"{len(base):,} rows are too many to sort ({MOST_SORTED:,}): a filter first, with =")
            rows = SortedRows(self.store, base, self.supply.registry, name, falling=falling)
            rows.start()
        if isinstance(self.rows, SortedRows):
            self._leave(self.rows)
        self.rows, self.begun = rows, None

    @property
    def order(self) -> SortedRows | None:
        """The field that rows are sorted by, None for the order of the capture."""
        return self.rows if isinstance(self.rows, SortedRows) else None

    @staticmethod
    def _leave(rows: OrderedRows) -> None:
        if isinstance(rows, ChosenRows | SortedRows):
            rows.stop()

    def waits(self, text: str) -> bool:
        """Return whether a filter asks for findings, and they are not known yet. Raises `FilterError`."""
        asks = bool(text.strip()) and compile_filter(text, self.supply.registry).asks_findings
        return asks and self.supply.named is None and not (self.supply.loaded and not self.supply.doing)

    def matcher(self, text: str) -> Matcher:
        """Return a filter at work. Raises `FilterError`."""
        supply = self.supply
        chosen = compile_filter(text, supply.registry)
        if chosen.asks_findings and supply.named is None:
            said = "findings are not known" + (" yet: the capture is still being judged" if supply.doing else "")
            raise FilterError(said, text, 0, len(text))
        return chosen.matcher(
            zero=self.store.zero, labels=supply.labels, named=supply.named, severities=supply.severities
        )

    def row(self, number: int) -> ListRow:
        """Return a row that is listed, by its number from 0."""
        return self.store.row(*self.rows.at(number))

    def number(self) -> int:
        """Return the number of the row that one is at, the last one if there are fewer."""
        count = len(self.rows)
        if self.anchor is None or not count:
            return 0
        return min(self.rows.find(*self.anchor), count - 1)

    def current(self) -> ListRow | None:
        """Return the row that one is at."""
        if not len(self.rows):
            return None
        return self.row(self.number())

    def go(self, number: int) -> None:
        """Go to a row by its number."""
        count = len(self.rows)
        self.anchor = self.rows.at(max(0, min(number, count - 1))) if count else None

    # ---- several rows

    def selected(self) -> range:
        """Return the numbers of the rows that are selected: the current one, or those from where a selection began."""
        if not len(self.rows):
            return range(0)
        now = self.number()
        begun = now if self.begun is None else min(self.rows.find(*self.begun), len(self.rows) - 1)
        return range(min(now, begun), max(now, begun) + 1)

    def filter_of(self, numbers: range) -> str:
        """Return a filter that selects these rows, as far as they have frames; empty if none has.

        More of them than a filter should name are a range of frames, under the filter that is applied. Raises
        `ValueError` for so many of a sorted list.
        """
        if len(numbers) <= MOST_NAMED:
            firsts = [min(places) + 1 for number in numbers if (places := self.places_of(self.row(number)))]
            return f"frame.number in {{{', '.join(map(str, firsts))}}}" if firsts else ""
        if self.order is not None:
            raise ValueError(f"of a sorted list {MOST_NAMED:,} rows are selected at most")
        first, last = (self.row(number) for number in (numbers[0], numbers[-1]))
        span = f"frame.number in {{{first.place + 1}..{max([last.place, *self.places_of(last)]) + 1}}}"
        return f"({self.filter}) && {span}" if self.filter else span

    def filter_of_all(self) -> str:
        """Return a filter that selects what is displayed: of a bus what has come until now: recording goes on."""
        if not self.supply.live or not len(self.store):
            return self.filter
        span = f"frame.number in {{{self.store.first + 1}..{self.store.frames}}}"
        return f"({self.filter}) && {span}" if self.filter else span

    # ---- a row in full

    def shown(self, row: ListRow, *, elements: bool = True) -> ShownRow:
        """Return a row in full, above all what somebody wrote about it and what happened there.

        `elements` says that those of arrays have lines of their own.
        """
        shown = self._whole(row)
        said = []
        for place in self.places_of(row):
            if text := self.said_of(place):
                said.append(DetailLine(0, f"Comment: {escape(text)}"))
            if place in self.supply.places:
                said.append(DetailLine(0, f"Event: {escape(self.supply.places[place])}"))
        lines = with_elements(shown.lines) if elements else shown.lines
        return shown._replace(lines=[*said, *map(self._labelled, lines)])

    def _labelled(self, line: DetailLine) -> DetailLine:
        """Return a line with the label of the node that it names."""
        if line.name not in ("dronecan.src", "dronecan.dst") or not line.value.isdigit():
            return line
        label = self.supply.labels.get(int(line.value))
        return line if label is None else line._replace(text=f'{line.text} "{escape(label)}"')

    def _whole(self, row: ListRow) -> ShownRow:
        if row.kind == TRANSFER:
            return self._transfer(row)
        time = self._time(row)
        if row.kind == EVENT:
            events = self.store.opened(row.segment).table("events").slice(row.entry, 1)
            told = {name: events.column(name)[0].as_py() for name in events.schema.names if name != "t"}
            line = self.pages.lines([row], 500)[0].text
            return ShownRow(row, event_lines(told, time, line[44:].strip()), [], None)
        frame = self.frames(row.place)
        if frame is None:
            return ShownRow(row, [], [], None)
        number = self.numbering.of(row.place)
        table = self.store.opened(row.segment).table("frames" if row.kind == 1 else "settled")
        verdict = int(table.column("verdict")[row.entry].as_py())
        rules = ", ".join(self._rules([row.place]))
        lines = frame_lines(number, frame, self.store.buses[frame.bus], verdict, time, rules)
        return ShownRow(row, lines, dump([(number, frame)], transfer=False), None)

    def _transfer(self, row: ListRow) -> ShownRow:
        batch = cut_transfers(self.store, [self.number_of(row)])
        clock = self.pages.clock()
        key = clock.mode, clock.zero, clock.digits, self.supply.named
        if self._tree is None or self._tree[0] != key:
            tree = Tree(self.supply.registry, clock, numbering=self.numbering, named=self.supply.named)
            self._tree = key, tree
        text = "".join(self._tree[1].texts(batch))
        places = batch.transfers.column("frame")[0].as_py()[:_MOST_FRAMES]
        frames = [(self.numbering.of(place), one) for place in places if (one := self.frames(place)) is not None]
        number = batch.transfers.column("transfer_id")[0].as_py()
        return ShownRow(row, with_transfer_id(detail_lines(text), number), dump(frames, transfer=True), batch)

    def number_of(self, row: ListRow) -> int:
        """Return the number of a transfer in the whole capture, from 0."""
        return self.store.segments[row.segment].first_transfer + row.entry

    def places_of(self, row: ListRow) -> list[int]:
        """Return the frames of a row, from 0; an event has none."""
        if row.kind == TRANSFER:
            found: list[int] = self.store.opened(row.segment).table("transfers").column("frame")[row.entry].as_py()
            return found
        return [] if row.kind == EVENT else [row.place]

    def content(self, row: ListRow) -> bytes:
        """Return the bytes that a transfer carries, or those of a frame that forms none."""
        if row.kind == TRANSFER:
            return bytes(self.store.opened(row.segment).table("transfers").column("payload")[row.entry].as_py())
        frame = self.frames(row.place) if row.kind != EVENT else None
        return b"" if frame is None else frame.data

    def said_of(self, place: int) -> str:
        """Return what somebody wrote about a frame, beside the capture or in it; empty for nothing."""
        mark, remark = self.marks.marks.get(place), self.supply.remarks.get(place, "")
        return remark if mark is None else mark.text or remark or mark.words

    def time_of(self, mark: Mark) -> int | None:
        """Return the time of a mark, which a file need not say."""
        return self.store.frame_time(mark.frame) if mark.t is None else mark.t

    def rules_of(self, row: ListRow) -> list[str]:
        """Return the rules that name a row."""
        return self._rules(self.places_of(row))

    def _rules(self, places: Sequence[int]) -> list[str]:
        if self.supply.named is None or not places:
            return []
        found = self.supply.named.between(min(places), max(places))
        return sorted({rule for place in places for rule in found.get(place, ())})

    def _time(self, row: ListRow) -> str:
        from analyzer.views.times import TimeFormat  # noqa: PLC0415 - once

        t = self.store.time(row)
        return "" if t is None else f"{TimeFormat('ad', digits=9).text(t)} (local)"

    # ---- who a row is of

    def conversation_of(self, row: ListRow) -> frozenset[int] | None:
        """Return the nodes that a transfer is between, None for other rows."""
        own = self.sender(row)
        if own is None:
            return None
        return frozenset((own["src"], own["dst"])) if self.is_service(own) else frozenset((own["src"],))

    def sender(self, row: ListRow) -> dict[str, int] | None:
        """Return the columns of a transfer that tell whose it is, None for other rows."""
        if row.kind != TRANSFER:
            return None
        table = self.store.opened(row.segment).table("transfers")
        names = ("bus", "kind", "type_id", "variant", "src", "dst", "transfer_id")
        return {name: table.column(name)[row.entry].as_py() for name in names}

    def type_name(self, sender: dict[str, int]) -> str:
        """Return the name of a type as a filter takes it, empty for an unknown one."""
        message = self.supply.registry.message(sender["kind"], sender["type_id"], sender["variant"])
        return "" if message is None else message.name.rpartition(".")[2]

    def is_service(self, sender: dict[str, int]) -> bool:
        """Return whether a transfer is a request or a response."""
        return KINDS[sender["kind"]] in ("request", "response")
