"""The filter of a request, applied to the batches of its run."""

from __future__ import annotations

import re
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.compiled import compile_filter
from analyzer.filter.language.errors import FilterError, listed, near
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.filter.compiled import Filter
    from analyzer.filter.matcher import Matcher, Matches
    from analyzer.rules.catalogue import Page
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.rules.vehicle.expected import Expected
    from analyzer.window.numbering import Numbering
    from analyzer.window.screen import Item
    from dissectors.kit import Array, Severity

NO_LABELS = "node.label is what a vehicle file calls a node: give one with --vehicle FILE.toml"
_BATCHES_KEPT = 256  # whose frames may still get another verdict


class RunFilter:
    """Marks the rows of a run's batches that its filter selects, and counts them.

    Args:
        run: whose request has a filter.
        text: another one, in place of that.

    Raises `FilterError` for one that is wrong, and what a vehicle file raises whose labels it names.
    """

    def __init__(self, run: Run, text: str | None = None) -> None:
        request = run.request
        self._run = run
        self.filter = compile_filter(text or request.filter or "", run.registry, wireshark=request.wireshark)
        self.labels = _labels(run) if self.filter.asks_labels else {}
        self._pages = _pages(run) if self.filter.asks_findings else {}
        self._severities = _severities(run) if self.filter.asks_findings else {}
        check_labels(self.filter, self.labels.values())
        check_rules(self.filter, self._pages)
        self.transfers = self.frames = self.errors = 0
        self._kept: deque[tuple[int, Array]] = deque(maxlen=_BATCHES_KEPT)
        self._named: NamedFrames | None = None
        self._missing = set(self.filter.names())
        self._buses: Sequence[str] = ()
        self._matcher: Matcher | None = None
        self._some = False  # something matches

    @property
    def judges(self) -> bool:
        """True if it asks what the rules have found."""
        return self.filter.asks_findings

    def know(self, named: NamedFrames) -> None:
        """Take the rules that name frames."""
        self._named = named

    def matcher(self, *, frame_list: bool = False) -> Matcher:
        """Return what evaluates it from the first batch on; with `frame_list` rows are frames, not transfers."""
        severities = {rule: page.severity for rule, page in self._pages.items()} | self._severities
        return self.filter.matcher(labels=self.labels, named=self._named, severities=severities, frame_list=frame_list)

    def unpack(self, *, rows: bool, colours: bool) -> None:
        """Have its run make no tables but those it asks for, those of the `rows` that it may select if they are shown.

        With `colours` all of them: rules of colours may ask for any.
        """
        if not colours:
            self._run.unpack_only(self.filter.shown() if rows else self.filter.tables)

    def only(self, run: Run) -> None:
        """Have a run make what the filter itself asks for, with nothing to show; of what it cannot select the sums."""
        run.unpack_only(self.filter.tables, self.filter.sessions(self.labels))

    def frame_matcher(self) -> RunFilter | None:
        """Return what chooses frames of a list, None if rows are transfers."""
        if not self._run.request.frame_list:
            return None
        self._matcher = self.matcher(frame_list=True)
        return self

    def feed(self, batch: Batch) -> Matches:
        """Take the next batch of a list of frames, and return what it chooses."""
        matches = (self._matcher or self.matcher(frame_list=True)).feed(batch)
        self.note(matches)
        self._some = self._some or bool(matches.members[1].any() or matches.frames.any())
        return matches

    def listed(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield rows that are listed, and count those that are no transfers: `frames` and `errors`."""
        for batch, rows, zero in items:
            mask = np.zeros(len(batch.frames), bool)
            mask[rows.frames] = True
            late = np.zeros(len(batch.settled), bool)
            late[rows.settled] = True
            self.frames += len(rows.frames) + self._settled(batch, late)
            self._kept.append((batch.first_frame, mask))
            self.errors += len(rows.events)
            yield batch, rows, zero

    def _settled(self, batch: Batch, late: Array) -> int:
        """Return how many frames more are listed once a verdict about earlier ones has come."""
        more = 0
        for place, shown in zip(batch.settled.column("frame").to_pylist(), late.tolist(), strict=True):
            for first, mask in self._kept:
                if first <= place < first + len(mask):
                    more += shown - int(mask[place - first])
                    mask[place - first] = shown
        return more

    def counted(self, items: Iterable[Item], numbering: Numbering) -> int:
        """Return how many rows of a list are selected: transfers, or of a list of frames these."""
        if not self._run.request.frame_list:
            return sum(len(rows.transfers) for _, rows, _ in items)
        from analyzer.views.frames.rows import FrameRows  # noqa: PLC0415 - few lists are of frames

        frames, count = FrameRows(self._run.registry, numbering, matcher=self.frame_matcher()), 0
        for batch, rows, _ in items:
            count += sum(len(table.rows) for table in frames.feed(batch, rows))
        return count + sum(len(table.rows) for table in frames.finish())

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches, marked."""
        matcher = self.matcher()
        for batch in batches:
            matches = matcher.feed(batch)
            selected = matches.selected()
            self.transfers += int(selected.transfers.sum())
            self._some = self._some or any(bool(mask.any()) for mask in selected)
            self.note(matches)
            yield replace(batch, selected=selected)

    def again(self, batches: Callable[[], Iterator[Batch] | None]) -> Callable[[], Iterator[Batch] | None]:
        """Return what reads the batches once more, marked."""

        def marked() -> Iterator[Batch] | None:
            found = batches()
            return None if found is None else self.over(found)

        return marked

    def note(self, matches: Matches) -> None:
        """Note which of the types that it names have been seen, and the interfaces."""
        self._buses = matches.buses
        if self._missing:
            self._missing = {name for name in self._missing if not matches.seen(self.filter.names()[name])}

    def conclude(self) -> bool:
        """Complain of types and interfaces that the whole capture does not have, and of what can never match.

        Return whether it is said why nothing matches.
        """
        run, said = self._run, False
        if run.stopped:
            return False
        for word in dict.fromkeys(one.text for one in self.filter.words if one.field == "frame.interface_name"):
            if word not in self._buses:
                known = f"it has {listed(self._buses)}" if any(self._buses) else "it names none"
                run.complain(f"{run.source.name}: has no interface {word!r:.60} ({known})")
                said = True
        if self._some or self.transfers + self.frames + self.errors:
            return False
        if missing := [name for name in self.filter.names() if name in self._missing]:
            has = "no " + ", no ".join(missing)
            run.complain(f"{run.source.name}: has {has}: the filter asks for what never occurs")
        elif reason := self.filter.apart:
            run.complain(f"-Y: {reason}")
        else:
            return said
        return True


def check_labels(chosen: Filter, labels: Iterable[str]) -> None:
    """Raise `FilterError` for a label that no node has."""
    _check(chosen, "node.label", set(labels), "no node in the vehicle file is called")


def check_rules(chosen: Filter, rules: Collection[str]) -> None:
    """Raise `FilterError` for a rule that does not exist."""
    _check(chosen, "finding.rule", rules, "no rule is called")


def _check(chosen: Filter, field: str, known: Collection[str], reason: str) -> None:
    """Raise `FilterError` for a word that a field is compared with and that is none of the known ones."""
    for word in chosen.words:
        if word.field == field and word.text not in known:
            meant = [one for one in known if _plain(one) == _plain(word.text)] or near(word.text, sorted(known))
            if any(one.startswith(f"{word.text}-") for one in known):
                hint = f'; for all of these write {field} contains "{word.text}-"'
            else:
                hint = f"; did you mean {listed(meant)}?" if meant else ""
            raise FilterError(f"{reason} {word.text!r:.60}{hint}", chosen.text, *word.span, meant)


def _plain(name: str) -> str:
    """Return a name as somebody may write it who has it by heart: TRF-003 as trf3."""
    return re.sub(r"[-_ ]|(?<!\d)0+(?=\d)", "", name.lower())


def _labels(run: Run) -> dict[int, str]:
    """Return what the vehicle file of a run calls its nodes."""
    expected = _expected(run)
    if expected is None:
        raise ValueError(NO_LABELS)
    return {node: one.label for node, one in expected.nodes.items() if one.label}


def _pages(run: Run) -> Mapping[str, Page]:
    """Return the pages of all rules, of those in a vehicle file, too."""
    from analyzer.rules.catalogue import load  # noqa: PLC0415 - few filters ask for findings

    expected = _expected(run)
    own = {} if expected is None or expected.own is None else expected.own.pages
    return {**load(run.registry), **own}


def _severities(run: Run) -> dict[str, Severity]:
    """Return the severities that the vehicle file of a run gives to rules."""
    expected = _expected(run)
    return {} if expected is None else {**expected.severities}


def _expected(run: Run) -> Expected | None:
    vehicle = run.request.rules.vehicle
    if vehicle is None:
        return None
    from pathlib import Path  # noqa: PLC0415

    from analyzer.rules.catalogue import load  # noqa: PLC0415
    from analyzer.rules.vehicle.expected import load as load_vehicle  # noqa: PLC0415 - few filters ask for these

    return load_vehicle(Path(vehicle), load(run.registry), run.registry)
