"""python-can with our formats: its tools convert, log and play them, as another process and as a library."""

from __future__ import annotations

import gzip
import os
import signal
import subprocess
import sys
import tomllib
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import can
import can.player
import pytest
from can.io import logger, player
from hypothesis import given
from kit.command import LIMIT, ROOT, wait_until
from kit.libraries import message
from kit.rows import EXTENDED, RX, TX, Fault, Frame, Record, records, text
from sources.test_python_can import SAMPLE, T0, captures

import analyzer
from analyzer.integrations.python_can import CaptureReader, McapWriter, PcapngWriter
from analyzer.sources import Source
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

HALVES = ("can.io.message_reader", "can.io.message_writer")
WRITERS = {".mcap": McapWriter, ".pcapng": PcapngWriter}
LOG = """\
(1700000000.000000) can0 05040601#A63500000000009C R
(1700000000.000180) vcan1 123#R R
(1700000000.002787) can0 1F043901##0000001CA0102030405060708 T
(1700000001.000000) can0 7FF# T
"""


@pytest.fixture
def plugged(tmp_path: Path) -> dict[str, str]:
    """The environment of a python-can that finds what pyproject.toml announces."""
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    folder = tmp_path / "plugged"
    about = folder / "plugged-0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: plugged\nVersion: 0\n")
    lines = [line for half in HALVES for line in (f"[{half}]", *(f"{k} = {v}" for k, v in points[half].items()))]
    (about / "entry_points.txt").write_text("\n".join(lines))
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, as the entry points would do it."""
    for suffix, writer in WRITERS.items():
        monkeypatch.setitem(logger.MESSAGE_WRITERS, suffix, writer)
    for suffix in (*WRITERS, ".pcap"):
        monkeypatch.setitem(player.MESSAGE_READERS, suffix, CaptureReader)


def convert(env: dict[str, str], *names: Path) -> None:
    subprocess.run([sys.executable, "-m", "can.logconvert", *map(str, names)], env=env, check=True, timeout=LIMIT)


def found(path: Path) -> list[Record]:
    source = Source(str(path))
    pieces = [piece for piece in rows(source.chunks()) if not isinstance(piece, bytes)]
    assert source.damage is None
    return records(pieces)


@pytest.mark.slow
def test_can_logconvert(tmp_path: Path, plugged: dict[str, str]) -> None:
    """From candump through all formats back to the same bytes."""
    paths = [tmp_path / name for name in ("a.log", "b.mcap", "c.pcapng", "d.log")]
    paths[0].write_text(LOG)
    for pair in pairwise(paths):
        convert(plugged, *pair)
    before = found(paths[0])
    assert len(before) == 4
    assert found(paths[3]) == before
    assert found(paths[2]) == before
    assert paths[1].read_bytes().startswith(b"\x89MCAP")


@pytest.mark.slow
def test_importing_the_plug_ins_is_cheap(plugged: dict[str, str]) -> None:
    """python-can imports them on each look-up; what it imports itself does not count."""
    code = (
        "import can, sys; before = set(sys.modules); "
        "import analyzer.integrations.python_can; print(*set(sys.modules) - before)"
    )
    done = subprocess.run([sys.executable, "-c", code], env=plugged, check=True, timeout=LIMIT, stdout=subprocess.PIPE)
    more = {name.partition(b".")[0].decode() for name in done.stdout.split()}
    assert not more & {"numpy", "pyarrow", "mcap", "zstandard", "lz4", "google", "rerun"}


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize("suffix", WRITERS)
def test_can_player(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"played{suffix}"
    sent = [record for record in SAMPLE if isinstance(record, Frame)]
    with can.Logger(path) as writer:
        for record in SAMPLE:
            writer(message(record))
    arguments = ["-i", "virtual", "-c", path.name, "--ignore-timestamps", "--gap", "0", str(path)]
    monkeypatch.setattr(sys, "argv", ["can_player", *arguments])
    with can.Bus(path.name, interface="virtual", preserve_timestamps=True) as bus:
        can.player.main()
        played = [bus.recv(timeout=LIMIT) for _ in sent]
        assert bus.recv(timeout=0) is None
    for got, record in zip(played, sent, strict=True):
        assert got is not None
        assert got.equals(message(record), timestamp_delta=None, check_channel=False, check_direction=False)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("suffix", WRITERS)
@given(found=captures())
def test_messages_come_back(suffix: str, found: list[Record], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("back") / f"x{suffix}"
    with WRITERS[suffix](path) as writer:
        for record in found:
            writer(message(record))
    with CaptureReader(path) as reader:
        back = list(reader)
    assert len(back) == len(found)
    for got, record in zip(back, found, strict=True):
        sent = message(record)
        assert got.channel == record.bus
        assert got.equals(sent, timestamp_delta=None, check_channel=False)
        assert round(got.timestamp * 10**6) == round(sent.timestamp * 10**6)


@pytest.mark.parametrize("suffix", WRITERS)
def test_error_frames_and_names_of_buses(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"x{suffix}"
    fault = Fault(T0, "can0", 4, bytes([0, 4, 0, 0, 0, 0, 0, 0]))
    with WRITERS[suffix](path) as writer:
        for name, way in (("vcan7", TX), (3, RX), (None, TX)):
            one = message(replace(fault, flags=way))
            one.channel = name
            writer(one)
    with CaptureReader(path) as reader:
        back = list(reader)
    assert [(one.channel, one.is_rx) for one in back] == [("vcan7", False), ("can3", True), ("can0", False)]
    assert {(one.is_error_frame, one.arbitration_id, bytes(one.data)) for one in back} == {(True, 4, fault.data)}


@pytest.mark.usefixtures("registered")
def test_any_capture_can_be_read(tmp_path: Path) -> None:
    """The suffix finds the reader; the content says what it is. Frames without a time have 0."""
    path = tmp_path / "log.pcap"
    path.write_text("".join(f"{'(1.500000) ' if n % 3 == 0 else ''}can0 123#{n:02X}\n" for n in range(40)))
    got = [(frame.timestamp, frame.arbitration_id, frame.data[0]) for frame in can.LogReader(path)]
    assert got == [(1.5 if n % 3 == 0 else 0.0, 0x123, n) for n in range(40)]
    path.write_bytes(b"\xfd7zXZ\0")
    with can.LogReader(path) as reader, pytest.raises(analyzer.CaptureError, match="looks like xz"):
        list(reader)


@pytest.mark.usefixtures("registered")
def test_gzip_around_it(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng.gz"
    with can.Logger(path) as writer:
        writer(message(SAMPLE[0]))
    assert gzip.decompress(path.read_bytes()).startswith(b"\n\r\r\n")
    (one,) = can.LogReader(path)
    assert one.equals(message(SAMPLE[0]), check_channel=False)


def test_what_cannot_be_read_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "x.pcapng"
    with PcapngWriter(path) as writer:
        for record in SAMPLE:
            writer(message(record))
    path.write_bytes(path.read_bytes()[:-5])
    with CaptureReader(path) as reader:
        assert len(list(reader)) == len(SAMPLE) - 1
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith(f"{path}: byte ")


def test_what_a_format_cannot_hold_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "x.mcap"
    with McapWriter(path) as writer:
        early = message(SAMPLE[4])
        early.timestamp = -1.0
        writer(early)
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith(f"{path}: the format cannot hold: ")
    assert caplog.messages[0].endswith(" (1)")


def test_appending(tmp_path: Path) -> None:
    """pcapng takes another section. MCAP ends with a summary: appending to nothing is all it can."""
    for writer_class, path in ((PcapngWriter, tmp_path / "x.pcapng"), (McapWriter, tmp_path / "x.mcap")):
        for _ in range(2 if writer_class is PcapngWriter else 1):
            with writer_class(path, append=True) as writer:
                writer(message(SAMPLE[0]))
    assert len(found(tmp_path / "x.pcapng")) == 2
    with pytest.raises(ValueError, match=r"^MCAP cannot be appended to"):
        McapWriter(tmp_path / "x.mcap", append=True)
    assert len(found(tmp_path / "x.mcap")) == 1


@pytest.mark.parametrize(
    "wrong",
    [
        can.Message(arbitration_id=0x800, is_extended_id=False),
        can.Message(arbitration_id=1 << 29),
        can.Message(timestamp=float("nan")),
        can.Message(timestamp=1e30),
        can.Message(data=bytes(9)),
        can.Message(data=b"ab", dlc=3),
    ],
)
def test_messages_that_no_bus_can_carry(wrong: can.Message, tmp_path: Path) -> None:
    with McapWriter(tmp_path / "x.mcap") as writer:
        writer(message(SAMPLE[0]))
        with pytest.raises(ValueError, match=r"^Timestamp: "):
            writer(wrong)
    assert found(tmp_path / "x.mcap") == SAMPLE[:1]


def test_a_writer_stops_once(tmp_path: Path) -> None:
    writer = McapWriter(tmp_path / "x.mcap")
    writer(message(SAMPLE[0]))
    writer.stop()
    writer.stop()
    assert found(tmp_path / "x.mcap") == SAMPLE[:1]


class _Full:
    """A disk that is full at once."""

    closed = False

    def write(self, _: bytes) -> int:
        raise OSError(28, "No space left on device")

    def flush(self) -> None:
        """Nothing."""

    def close(self) -> None:
        self.closed = True


def test_a_full_disk_is_told_by_the_next_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.integrations.python_can._PATIENCE", 0)
    writer = PcapngWriter(tmp_path / "x.pcapng")
    disk: Any = _Full()
    real, writer.file = writer.file, disk
    real.close()
    monkeypatch.setattr(writer, "_sink", _Sink(disk))
    writer(message(SAMPLE[0]))
    wait_until(lambda: writer._failed is not None)
    with pytest.raises(OSError, match="No space left"):
        writer(message(SAMPLE[0]))
    with pytest.raises(OSError, match="No space left"):
        writer.stop()
    assert disk.closed


class _Sink:
    def __init__(self, file: Any) -> None:
        self._file = file

    def write(self, _: object) -> None:
        self._file.write(b"")

    flush = close = write
    lost: ClassVar[dict[str, int]] = {}


@pytest.fixture
def recording(tmp_path: Path, plugged: dict[str, str]) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """A process that writes 10,000 messages and then nothing more."""
    path = tmp_path / "killed.mcap"
    code = (
        "import sys, time, can\n"
        "writer = can.Logger(sys.argv[1])\n"
        "for n in range(10000): writer(can.Message(arbitration_id=n, timestamp=1.7e9 + n, data=bytes(8)))\n"
        "print('written', flush=True)\n"
        "time.sleep(600)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(path)], env=plugged, stdout=subprocess.PIPE)
    yield process, path
    process.kill()
    process.communicate()


@pytest.mark.slow
def test_a_killed_recording_has_nearly_everything(recording: tuple[subprocess.Popen[bytes], Path]) -> None:
    process, path = recording
    assert process.stdout is not None
    assert process.stdout.readline() == b"written\n"

    def count() -> int:
        source = Source(str(path))
        return sum(piece.frames for piece in rows(source.chunks()) if not isinstance(piece, bytes))

    wait_until(lambda: count() == 10_000)
    process.send_signal(signal.SIGKILL)
    process.wait(LIMIT)
    assert count() == 10_000


def test_a_log_with_every_kind_of_frame(tmp_path: Path) -> None:
    """What candump says, read as messages and written again, is the same."""
    log = tmp_path / "x.log"
    log.write_text(LOG)
    with CaptureReader(log) as reader, McapWriter(tmp_path / "x.mcap") as writer:
        for one in reader:
            writer(one)
    assert found(tmp_path / "x.mcap") == records(text(LOG))
    assert found(tmp_path / "x.mcap")[0] == Frame(
        T0, "can0", 0x05040601, EXTENDED | RX, bytes.fromhex("A63500000000009C")
    )
    assert found(tmp_path / "x.mcap")[3] == Frame(T0 + 10**9, "can0", 0x7FF, TX)
