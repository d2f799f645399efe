"""`analyzer.triage`: what happened in a capture."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from shlex import quote
from typing import TYPE_CHECKING

from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.flight.witness import Witness
from analyzer.sources import CaptureError
from analyzer.sources.merge import Plan
from analyzer.sources.origin import given
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    from analyzer.app.capture import Capture
    from analyzer.decode.engine import Batch
    from analyzer.flight.flights import Flight
    from analyzer.flight.verdict.model import Triage, Verdict
    from analyzer.sources.dataflash import AutopilotLog
    from analyzer.sources.origin import Origin

_AROUND, _SEEN = "100ms", "5s"


def triage(
    captures: Capture | Origin | Sequence[Origin],
    *,
    log: Origin | None = None,
    log_start: int | None = None,
    dialects: Mapping[int, Collection[str]] | None = None,
    same_bus: bool = False,
    dissectors_: Sequence[Path] = (),
    trust_dissectors: bool = False,
    drawn: bool = False,
) -> Triage:
    """Return what happened in captures, which are parts of one recording or of one vehicle: they are merged by time.

    Args:
        captures: of any format, as paths or binary file objects with a name; or what `open_capture` gave, which has
            been told how to read it and is read anew.
        log: the autopilot's own log of the flight, ArduPilot's dataflash.
        log_start: how long after the first frame the autopilot started, in ns, if its outputs are not to tell that.
        dialects: readings of doubtful fields by node ID, against the node's own data.
        same_bus: recordings of one bus, of which what repeats is left out.
        dissectors_: folders with further data types.
        trust_dissectors: run the Python that these folders bring.
        drawn: keep what time lines are drawn from, in `timelines`.

    A capture that is damaged is read as far as that goes. Raises `CaptureError` for one, or a log, that cannot be
    opened, and `ValueError` for arguments that make no sense (`ProfileError` is such).
    """
    from analyzer.app.capture import Capture  # noqa: PLC0415 - commands look at a run of their own

    if isinstance(captures, Capture):
        if dialects or same_bus or dissectors_ or trust_dissectors:
            raise ValueError("an opened capture has been told how to read it: give that to open_capture")
        request = captures.request
        if request.filter is not None:
            raise ValueError("what a filter selects of a capture cannot be judged: open it without one")
    else:
        several = list(captures) if isinstance(captures, Sequence) and not isinstance(captures, str) else [captures]
        if not several:
            raise ValueError("no capture is given")
        chosen = tuple((node, choice) for node, choices in (dialects or {}).items() for choice in choices)
        folders = tuple(dissectors_)
        request = Request(
            tuple(map(given, several)), Plan(same_bus=same_bus), folders, folders if trust_dissectors else (),
            rules=RuleChoice(dialects=chosen),
        )  # fmt: skip
    run = Run(request)
    looked = RunTriage(run, None if log is None else autopilot_log(log, log_start), drawn=drawn)
    with suppress(CaptureError):  # what was readable has been looked at
        for _ in looked.over(run.inside()):
            pass
    if run.state == "refused":
        raise CaptureError(run.source.name, "", "cannot be read")
    return looked.found()


def autopilot_log(of: Origin, start: int | None = None) -> AutopilotLog:
    """Return what triage reads of an autopilot's log; see `triage` for its `start`. Raises `CaptureError`."""
    from analyzer.flight.autopilot.track import OUTPUTS  # noqa: PLC0415 - few captures have a log beside them
    from analyzer.flight.autopilot.words import SAID  # noqa: PLC0415
    from analyzer.sources.dataflash import read_log  # noqa: PLC0415

    return replace(read_log(of, (OUTPUTS, *SAID)), given=start)


class RunTriage:
    """Looks at the batches of a run while somebody else may use them.

    Args:
        run: not read yet. Raises `ProfileError` for a wrong `plots.toml`.
        log: the autopilot's own log of the flight.
        drawn: it is to have time lines.

    `witness` is what has been seen.
    """

    def __init__(self, run: Run, log: AutopilotLog | None = None, *, drawn: bool = False) -> None:
        self._run = run
        self.witness = Witness(run.registry, log, drawn=drawn)
        self._frames = 0

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches, and look at each.

        Not in a thread of its own beside that of the rules: both are Python over small columns, and two of such wait
        more for each other than they gain.
        """
        for batch in batches:
            self.feed(batch)
            yield batch
            del batch  # else it would be there while the next one is made

    def feed(self, batch: Batch) -> None:
        """Look at the next batch."""
        self.witness.feed(batch)
        self._frames += len(batch.frames)

    def found(self) -> Triage:
        """Return what happened, after the last batch."""
        from analyzer.flight.inquest import inquest  # noqa: PLC0415 - not before all has been seen

        clock = self.witness.clock
        return inquest(
            self.witness, self._run.request.names, self._run.engine.buses, start=clock.start, end=clock.last,
            frames=self._frames, commands=self._next,
        )  # fmt: skip

    def _next(self, verdict: Verdict, flight: Flight | None) -> Sequence[str]:
        """Return at most three commands that can be pasted: none about a bus, which nothing reads again."""
        if self._run.source.live and "-" not in self._run.request.names:
            return ()
        names = " ".join(quote(name) for name in self._run.request.names)
        chosen = f" --flight {flight.number}" if flight is not None else ""
        if verdict.t_end is None:
            more = f"tailbyte plot {names}{chosen}" if verdict.told else f"tailbyte check {names}"
            before = [one.number for one in self.witness.flights()[:-1] if one.end != "landed"]
            last = [f"tailbyte triage {names} --flight {before[-1]}"] if before else []
            return [f"tailbyte events {names}", more, *last]
        at = f" --at {verdict.frame + 1}" if verdict.frame is not None else ""
        at += f" -Y 'node == {verdict.node}'" if verdict.kind == "device" else ""
        near, seen = "", chosen
        if verdict.frame is not None:
            near, seen = (f" --around {verdict.frame + 1}+-{span}" for span in (_AROUND, _SEEN))
        return [f"tailbyte view {names}{at}", f"tailbyte decode {names}{near}", f"tailbyte plot {names}{seen}"]
