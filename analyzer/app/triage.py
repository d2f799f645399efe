"""`analyzer.triage`: what happened in a capture."""

from __future__ import annotations

from shlex import quote
from typing import TYPE_CHECKING

from analyzer.triage.inquest import inquest
from analyzer.triage.witness import Witness

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.triage.flights import Flight
    from analyzer.triage.verdict.model import Triage, Verdict

_AROUND = "100ms"


class RunTriage:
    """Looks at the batches of a run while somebody else may use them.

    Args:
        run: not read yet. Raises `ProfileError` for a wrong `plots.toml`.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._witness = Witness(run.registry)
        self._frames = 0

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches, and look at each."""
        for batch in batches:
            self._witness.feed(batch)
            self._frames += len(batch.frames)
            yield batch

    def found(self) -> Triage:
        """Return what happened, after the last batch."""
        clock = self._witness.clock
        return inquest(
            self._witness, self._run.request.names, self._run.engine.buses, start=clock.start, end=clock.last,
            frames=self._frames, commands=self._next,
        )  # fmt: skip

    def _next(self, verdict: Verdict, flight: Flight | None) -> Sequence[str]:
        """Return at most three commands that can be pasted."""
        names = " ".join(quote(name) for name in self._run.request.names)
        if verdict.t_end is None or verdict.kind == "none":
            return [f"tailbyte check {names}", f"tailbyte events {names}"]
        around = f" --around {verdict.frame + 1}+-{_AROUND}" if verdict.frame is not None else ""
        chosen = f" --flight {flight.number}" if flight is not None else ""
        return [f"tailbyte decode {names}{around}", f"tailbyte plot {names}{chosen}"]
