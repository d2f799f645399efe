"""The request of a live session: frozen data that it is made from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.app.live.hook import FindingCommand
    from analyzer.app.live.session_recording import SessionPlan
    from analyzer.filter.compiled import Filter
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface
    from analyzer.views.options import WriterOptions

LiveMode = Literal["list", "monitor", "browser", "quiet"]


@dataclass(frozen=True, slots=True)
class LiveRequest:
    """A live session as it is asked for.

    `buses` are interfaces with what is let through, `mode` and `view` how they are shown, `flush` asks for it more
    often. `plan` is the recording, `every` are the seconds between two lines about the state, `hardware` asks for the
    controller's time stamps. `plot` is the address of a viewer, empty for a new one. `bit_rate` is what is known of it.
    `status_file` is where its state is written, `command` is run for findings, `filter` chooses the rows of a list.
    `drawn` says that a report at the end has time lines.
    """

    buses: tuple[tuple[Interface, Filters], ...]
    mode: LiveMode
    view: WriterOptions
    plan: SessionPlan
    every: float
    flush: bool = False
    hardware: bool = False
    plot: str | None = None
    bit_rate: int | None = None
    status_file: str | None = None
    command: FindingCommand | None = None
    filter: Filter | None = None
    drawn: bool = False

    @property
    def at_once(self) -> bool:
        """True if findings are to be told with the rows that they are about: somebody waits for them."""
        plan = self.plan
        return self.asks_findings or self.flush or bool(plan.trigger or plan.autostop.findings or self.command)

    @property
    def asks_findings(self) -> bool:
        """True if the rows of the list are chosen by findings."""
        return self.filter is not None and self.filter.asks_findings

    @property
    def counted(self) -> set[str]:
        """The interfaces of which the kernel tells every drop."""
        return {interface.name for interface, _ in self.buses if interface.kind == "socketcan"}

    @property
    def name(self) -> str:
        """All names."""
        return "+".join(interface.name for interface, _ in self.buses)
