"""The recording of a live session: the options put together, and what there is to say of it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.request import short_names
from analyzer.app.targets import capture_form
from analyzer.board.snapshot import RecordingState as State
from analyzer.live.autostop import Autostop, parse_autostop
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.plan import RecordingPlan
from analyzer.live.recording.pre_trigger import PreTriggerRecorder
from analyzer.live.recording.ring import parse_ring
from analyzer.live.recording.trigger import Trigger, parse_trigger
from analyzer.report import wording
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from contextlib import ExitStack

    from analyzer.live.capture_loop import Recorder
    from analyzer.sources.errors import CaptureError


_FORMS = {"candump": "candump text", "mcap": "MCAP", "pcapng": "pcapng"}


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """A recording and its end as somebody asks for them, in the words of the options."""

    path: str | None
    form: str | None
    compression: str | None
    force: bool
    ring: Sequence[str]
    autostop: Sequence[str]
    count: int | None
    trigger: Sequence[str]
    pre: str | None
    post: str | None


class SessionPlan:
    """A recording as it was asked for, and its end. Raises `ValueError` for arguments that do not go together."""

    def __init__(self, asked: RecordingOptions, rules: Collection[str], header: str) -> None:
        self.header = header
        self.trigger = parse_trigger(asked.trigger, asked.pre, asked.post, rules)
        self.autostop = parse_autostop(asked.autostop, asked.count, rules)
        ring = parse_ring(asked.ring)
        self.recording: RecordingPlan | None = None
        if asked.path is None:
            given = {
                "-b": ring, "--trigger": self.trigger, "-F": asked.form, "--compression": asked.compression,
                "-a filesize:": self.autostop.size, "-a files:": self.autostop.files,
            }  # fmt: skip
            if option := next((name for name, value in given.items() if value), None):
                raise ValueError(f"{option} is for a recording: add -w FILE")
            return
        if ring is not None and asked.path == "-":
            raise ValueError("-b: files of a ring need names: -w FILE")
        if self.autostop.files is not None and ring is None:
            raise ValueError("-a files: counts the files of a ring: add -b")
        form, packing = capture_form(asked.path, asked.form, asked.compression, pipe="candump")
        self.recording = RecordingPlan(
            asked.path, form, packing, asked.compression or "zstd", ring, asked.force, self.autostop.files, header
        )

    @property
    def file(self) -> str:
        """The one file that has every frame of the session, empty if there is no such file."""
        plan = self.recording
        return (
            "" if plan is None or plan.ring is not None or self.trigger is not None or plan.path == "-" else plan.path
        )


@dataclass(slots=True)
class RecordedFile:
    """A file of the recording, as a report names it; its digest is not known while it is written."""

    name: str
    size: int
    form: str
    notes: list[str] = field(default_factory=list)
    unit: str = "record"
    digest: str = ""
    hashed: bool = False
    damage: CaptureError | None = None

    @property
    def origin(self) -> str:
        """The path."""
        return self.name


class SessionRecording:
    """The recording of a session, or that there is none.

    Args:
        plan: what was asked for.
        stack: closes it at the latest.

    Raises `TargetError` if the file cannot be opened.
    """

    def __init__(self, plan: SessionPlan, stack: ExitStack) -> None:
        self.file_recorder: FileRecorder | None = None
        self.recorder: Recorder | None = None
        self._plan = plan
        if plan.recording is not None:
            self.recorder = self.file_recorder = stack.enter_context(FileRecorder(plan.recording))
            if plan.trigger is not None:
                self.recorder = PreTriggerRecorder(self.file_recorder, Trigger(plan.trigger))
        self.header = plan.header
        self.autostop = Autostop(plan.autostop, self.file_recorder)

    @property
    def name(self) -> str:
        """The name of the capture in a report; empty if there is none to look at again."""
        return "" if not self.files else short_names([self.files])[0]

    @property
    def files(self) -> Sequence[str]:
        """The files that `check` would read to see the same."""
        plan, recorder = self._plan, self.file_recorder
        if plan.recording is None or recorder is None or plan.recording.path == "-":
            return ()
        return () if plan.trigger is not None or recorder.lost or recorder.begun_anew else recorder.files

    def stored(self) -> list[RecordedFile]:
        """Return the files, for the facts of a report."""
        recording = self._plan.recording
        return (
            []
            if recording is None
            else [RecordedFile(name, _size(name), _FORMS[recording.form]) for name in self.files]
        )

    def now(self) -> State | None:
        """Return how it goes, for a monitor."""
        recorder = self.file_recorder
        if recorder is None:
            return None
        files = recorder.files
        return State(files[-1] if files else "", recorder.bytes, recorder.frames, recorder.lost, recorder.problem or "")

    def words(self) -> str:
        """Say how it goes, in a few words."""
        now = self.now()
        if now is None:
            return ""
        return f"recording has ended: {now.problem}" if now.problem else f"{now.file}: {wording.size(now.size)}"

    def problems(self) -> list[str]:
        """Return why it is not whole."""
        recorder = self.file_recorder
        if recorder is None or recorder.problem is None or recorder.gone:
            return []
        return [recorder.problem]

    def end(self) -> None:
        """Finish it, as nothing more will be received; but not before the last finding if these say what is in it."""
        if not isinstance(self.recorder, PreTriggerRecorder):
            self.close()

    def close(self) -> None:
        """Finish it."""
        if isinstance(self.recorder, PreTriggerRecorder):
            self.recorder.close()
        if self.file_recorder is not None:
            self.file_recorder.close()

    def account(self, bit_rate: int | None) -> Iterator[str]:
        """Say what became of it, and what finds in it the same as the session did; `bit_rate` is what was known."""
        recorder = self.file_recorder
        if recorder is None:
            return
        names = recorder.files
        where = wording.safe(names[-1]) if names else "nothing"
        more = f" and {wording.plural(len(names) - 1, 'file')} before it" if len(names) > 1 else ""
        lost = f", {recorder.lost:,} not recorded" if recorder.lost else ""
        errors = f" and {wording.plural(recorder.error_frames, 'error frame')}" if recorder.error_frames else ""
        yield f"recorded: {recorder.frames:,} frames{errors}, {wording.size(recorder.bytes)}, in {where}{more}{lost}"
        if len(self.files) == 1:
            rate = "" if bit_rate is None else f" --bitrate {bit_rate}"
            yield f"the same verdict: tailbyte check {wording.argument(self.files[0])}{rate}"


def _size(name: str) -> int:
    with suppress(OSError):
        return Path(name).stat().st_size
    return 0
