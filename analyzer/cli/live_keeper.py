"""What of a live session is recorded: the options put together, and what there is to say of it."""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.board.snapshot import Recording as State
from analyzer.cli import options
from analyzer.cli.live_status import size
from analyzer.conformance import ids
from analyzer.live.autostop import Autostop, parse_autostop
from analyzer.live.dashcam import Dashcam
from analyzer.live.recording import Recorder, RecordingPlan
from analyzer.live.ring import parse_ring
from analyzer.live.trigger import Trigger, parse_trigger
from analyzer.report import wording

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from contextlib import ExitStack

    from analyzer.live.pump import Keeper


_FORMS = {"candump": "candump text", "mcap": "MCAP", "pcapng": "pcapng"}


class Plan:
    """What is to be recorded and when it is enough. Raises `ValueError` for arguments that do not go together."""

    def __init__(self, args: argparse.Namespace, rules: Collection[str], header: str) -> None:
        self.header = header
        self.trigger = parse_trigger(args.trigger, args.pre, args.post, rules)
        self.autostop = parse_autostop(args.autostop, args.count, rules)
        ring = parse_ring(args.ring)
        self.recording: RecordingPlan | None = None
        if args.record is None:
            given = {
                "-b": ring, "--trigger": self.trigger, "-F": args.record_form, "--compression": args.compression,
                "-a filesize:": self.autostop.size, "-a files:": self.autostop.files,
            }  # fmt: skip
            if option := next((name for name, value in given.items() if value), None):
                raise ValueError(f"{option} is for a recording: add -w FILE")
            return
        if ring is not None and args.record == "-":
            raise ValueError("-b: files of a ring need names: -w FILE")
        if self.autostop.files is not None and ring is None:
            raise ValueError("-a files: counts the files of a ring: add -b")
        how = argparse.Namespace(output=args.record, form=args.record_form, compression=args.compression)
        form, packing = options.capture_form(how, pipe="candump")
        self.recording = RecordingPlan(
            args.record, form, packing, args.compression or "zstd", ring, args.force, self.autostop.files, header
        )


@dataclass(slots=True)
class Stored:
    """A file of the recording, as a report names it; its digest is not known while it is written."""

    name: str
    size: int
    form: str
    notes: list[str] = field(default_factory=list)
    unit: str = "record"
    digest: str = ""


class Recording:
    """The recording of a session, or that there is none.

    Args:
        plan: what was asked for.
        stack: closes it at the latest.

    Raises `TargetError` if the file cannot be opened.
    """

    def __init__(self, plan: Plan, stack: ExitStack) -> None:
        self.recorder: Recorder | None = None
        self.keeper: Keeper | None = None
        self._plan = plan
        if plan.recording is not None:
            self.keeper = self.recorder = stack.enter_context(Recorder(plan.recording))
            if plan.trigger is not None:
                self.keeper = self.dashcam = Dashcam(self.recorder, Trigger(plan.trigger))
        self.header = plan.header
        self.autostop = Autostop(plan.autostop, self.recorder)

    @property
    def name(self) -> str:
        """Of the capture in a report; empty if there is none to look at again."""
        return "" if not self.files else ids([self.files])[0]

    @property
    def files(self) -> Sequence[str]:
        """What `check` would read to see the same."""
        plan, recorder = self._plan, self.recorder
        if plan.recording is None or recorder is None or plan.recording.path == "-":
            return ()
        return () if plan.trigger is not None or recorder.lost else recorder.files

    def stored(self) -> list[Stored]:
        """The files, for the facts of a report."""
        recording = self._plan.recording
        return [] if recording is None else [Stored(name, _size(name), _FORMS[recording.form]) for name in self.files]

    def now(self) -> State | None:
        """How it goes, for a monitor."""
        recorder = self.recorder
        if recorder is None:
            return None
        files = recorder.files
        return State(files[-1] if files else "", recorder.bytes, recorder.frames, recorder.lost, recorder.problem or "")

    def words(self) -> str:
        """How it goes, in a few words."""
        now = self.now()
        if now is None:
            return ""
        return f"recording has ended: {now.problem}" if now.problem else f"{now.file}: {size(now.size)}"

    def problems(self) -> list[str]:
        """Why it is not whole."""
        recorder = self.recorder
        if recorder is None or recorder.problem is None or recorder.gone:
            return []
        return [recorder.problem]

    def close(self) -> None:
        """Finishes it."""
        if isinstance(self.keeper, Dashcam):
            self.keeper.close()
        if self.recorder is not None:
            self.recorder.close()

    def account(self, bit_rate: int | None) -> Iterator[str]:
        """What has become of it, and what finds in it the same as the session did; `bit_rate` is what was known."""
        recorder = self.recorder
        if recorder is None:
            return
        names = recorder.files
        where = wording.safe(names[-1]) if names else "nothing"
        more = f" and {wording.plural(len(names) - 1, 'file')} before it" if len(names) > 1 else ""
        lost = f", {recorder.lost:,} not recorded" if recorder.lost else ""
        yield f"recorded: {recorder.frames:,} frames, {size(recorder.bytes)}, in {where}{more}{lost}"
        if len(self.files) == 1:
            rate = "" if bit_rate is None else f" --bitrate {bit_rate}"
            yield f"the same verdict: tailbyte check {wording.argument(self.files[0])}{rate}"


def _size(name: str) -> int:
    with suppress(OSError):
        return Path(name).stat().st_size
    return 0
