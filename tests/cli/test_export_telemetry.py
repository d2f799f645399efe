"""MCAP with telemetry: read with the `mcap` package and decoded with Google's own Protocol Buffers."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pytest
from google.protobuf import descriptor_pool
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from kit.command import CAPTURES, HOVER
from kit.exported import expected, names_of, read_mcap, same
from mcap.reader import make_reader

import analyzer
from analyzer.sinks.telemetry_schema import identifier, schema

if TYPE_CHECKING:
    from collections.abc import Callable

    from google.protobuf.message import Message

    Main = Callable[..., tuple[int, str, str]]

FAULTS = CAPTURES / "faults.log"
ALL = sorted(path for path in CAPTURES.iterdir() if path.suffix in (".log", ".txt"))
BASIC = ("frames", "transfers", "events")


def value(message: Message) -> dict[str, Any]:
    """Fields by name, an absent one is None; nothing that the descriptor does not name."""
    out = {}
    for field in message.DESCRIPTOR.fields:
        cell = getattr(message, field.name)
        if field.is_repeated:
            out[field.name] = [value(one) if field.message_type else one for one in cell]
        elif not message.HasField(field.name):
            out[field.name] = None
        else:
            out[field.name] = value(cell) if field.message_type else cell
    return out


def in_mcap(row: dict[str, Any], table: pa.Table) -> dict[str, Any]:
    """How a row of the tables reads: time and sender left out, absent lists empty, raw text as bytes."""
    out = {}
    for name, cell in row.items():
        if name in ("t", "bus", "src"):
            continue
        field = table.schema.field(name) if name in table.column_names else None
        if field is None or not pa.types.is_list(field.type):
            out[identifier(name)] = lists(cell)
        elif field.type.value_type == pa.uint8() and {b"text", b"hex"} & set(field.metadata or {}):
            out[identifier(name)] = None if cell is None else bytes(cell)
        else:
            out[identifier(name)] = [float("nan") if one is None else lists(one) for one in cell or []]
    return out


def lists(cell: Any) -> Any:
    """Lists that are absent in a structure are empty."""
    if isinstance(cell, dict):
        return {name: lists(inner) for name, inner in cell.items()}
    return [lists(inner) for inner in cell] if isinstance(cell, list) else cell


def alike(got: Any, wanted: Any) -> bool:
    """Equal; an absent list cannot be told from an empty one."""
    if isinstance(got, dict) and isinstance(wanted, dict):
        return list(got) == list(wanted) and all(alike(got[name], wanted[name]) for name in got)
    if isinstance(got, list) and got and isinstance(wanted, list):
        return len(got) == len(wanted) and all(map(alike, got, wanted))
    return (got == [] and not wanted) or same(got, wanted)


@pytest.mark.slow
@pytest.mark.parametrize("capture", ALL, ids=lambda path: path.stem)
def test_every_message_is_there(command: Main, tmp_path: Path, capture: Path) -> None:
    command("export", capture, "-o", tmp_path / "out.mcap")
    topics = read_mcap(tmp_path / "out.mcap")
    opened = analyzer.open_capture(capture)
    wanted: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    for name in names_of(opened):
        if name in BASIC:
            continue
        table = opened.table(name)
        for row in expected(opened, name):
            wanted[f"/{identifier(row['bus'])}/node_{row['src']}/{name}"].append((row["t"] or 0, in_mcap(row, table)))
    assert {topic for topic in topics if "/node_" in topic} == set(wanted)
    for topic, rows in wanted.items():
        got = [(t, value(message)) for t, message in topics[topic]]
        assert [t for t, _ in got] == sorted(t for t, _ in rows), topic
        for left, right in zip(got, sorted(rows, key=lambda row: row[0]), strict=True):
            assert alike(left[1], right[1]), (topic, left, right)


@pytest.mark.slow
def test_raw_frames_are_beside_and_read_again(command: Main, tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    _, _, err = command("export", FAULTS, "-o", path)
    before, after = analyzer.open_capture(FAULTS), analyzer.open_capture(path)
    for name in ("t", "id", "data", "verdict"):
        assert after.table("frames").column(name).to_pylist() == before.table("frames").column(name).to_pylist()
    assert after.buses == before.buses
    assert "1966 frames written" in err
    assert after.totals.lines["other"] > 1000  # telemetry is no CAN


def test_events_are_log_messages(command: Main, tmp_path: Path) -> None:
    command("export", FAULTS, "-o", tmp_path / "out.mcap")
    topics = read_mcap(tmp_path / "out.mcap")
    said = sorted(
        (t, log.level, log.message, log.name) for name in ("/can0/events", "/events") for t, log in topics[name]
    )
    rows = expected(analyzer.open_capture(FAULTS), "events")
    assert len(said) == len(rows) == 5
    frames = expected(analyzer.open_capture(FAULTS), "frames")
    for row in rows:
        level = {"error frame": 4, "drop": 4}.get(row["kind"], 3)
        t = row["t"]
        if t is None:  # at the frame in front of it
            t = max(frame["t"] for frame in frames if frame["line"] < row["line"])
        (found,) = [one for one in said if one[0] == t and row["kind"] in one[2]]
        assert found[1] == level
        assert f"(record {row['line']})" in found[2]
        assert found[3] == (row["bus"] or "")
    log = topics["/can0/events"][0][1]
    assert log.timestamp.ToNanoseconds() == topics["/can0/events"][0][0]
    assert log.DESCRIPTOR.full_name == "foxglove.Log"


def test_chosen_tables_and_windows(command: Main, tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    command("export", HOVER, "-o", path, "--table", "ESCStatus")
    assert set(read_mcap(path)) == {f"/can0/node_{node}/ESCStatus" for node in (11, 12, 13, 14)}
    command("export", HOVER, "-o", path, "--table", "frames", "--frames", "100-199")
    assert {topic: len(rows) for topic, rows in read_mcap(path).items()} == {"/can0/can": 100}


@pytest.mark.slow
def test_many_batches_make_the_same_messages(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    command("export", FAULTS, "-o", tmp_path / "one.mcap")
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    monkeypatch.setattr("analyzer.sinks.telemetry.CHUNK", 500)
    command("export", FAULTS, "-o", tmp_path / "many.mcap")
    one, many = read_mcap(tmp_path / "one.mcap"), read_mcap(tmp_path / "many.mcap")
    assert {topic: sorted(map(str, rows)) for topic, rows in one.items()} == {
        topic: sorted(map(str, rows)) for topic, rows in many.items()
    }


def test_the_file_says_what_it_is_made_of(command: Main, tmp_path: Path) -> None:
    command("export", HOVER, "-o", tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        (about,) = reader.iter_metadata()
    assert about.name == "tailbyte"
    assert about.metadata["tailbyte.capture"] == str(HOVER)
    channel = next(c for c in summary.channels.values() if c.topic == "/can0/node_11/ESCStatus")
    assert channel.metadata["unit.voltage"] == "V"
    assert channel.metadata["type"] == "uavcan.equipment.esc.Status"
    assert (channel.metadata["node"], channel.metadata["bus"]) == ("11", "can0")
    of = summary.schemas[channel.schema_id]
    assert (of.name, of.encoding) == ("tailbyte.ESCStatus", "protobuf")
    (descriptor,) = FileDescriptorSet.FromString(of.data).file
    fields = {field.name: field for field in descriptor.message_type[0].field}
    comments = {tuple(place.path): place.leading_comments for place in descriptor.source_code_info.location}
    assert comments[4, 0, 2, fields["voltage"].number - 1] == " unit V; clause 4.4.3 no 5-6\n"
    assert fields["voltage"].type == FieldDescriptorProto.TYPE_FLOAT
    assert fields["error_count_mode"].type == FieldDescriptorProto.TYPE_UINT32
    assert fields["error_count_mode_text"].type == FieldDescriptorProto.TYPE_STRING
    assert summary.statistics.message_count == sum(summary.statistics.channel_message_counts.values())
    assert summary.statistics.metadata_count == 1


def test_names_that_would_collide_are_told_apart() -> None:
    columns = pa.schema([("a.b", pa.int8()), ("a_b", pa.int8()), ("aB", pa.int8()), ("1st", pa.bool_())])
    (file,) = FileDescriptorSet.FromString(schema("x.y", columns).descriptors).file
    assert [field.name for field in file.message_type[0].field] == ["a_b", "a_b_2", "aB_3", "_1st"]
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    assert pool.FindMessageTypeByName("tailbyte.x_y")


def test_more_senders_than_there_are_channels(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.sinks.telemetry.MOST_CHANNELS", 2)
    command("export", HOVER, "-o", tmp_path / "out.mcap", "--table", "ESCStatus")
    counts = {topic: len(rows) for topic, rows in read_mcap(tmp_path / "out.mcap").items()}
    assert counts == {"/can0/node_11/ESCStatus": 60, "/can0/node_12/ESCStatus": 60, "/others/ESCStatus": 120}


@pytest.mark.slow
def test_rerun_opens_it(command: Main, tmp_path: Path) -> None:
    """Its own checks, and what becomes of the messages: structures of numbers, and text of the events."""
    command("export", FAULTS, "-o", tmp_path / "out.mcap")
    rerun = shutil.which("rerun", path=str(Path(sys.executable).parent)) or "rerun"

    def ask(*args: object) -> str:
        done = subprocess.run([rerun, *map(str, args)], capture_output=True, text=True, check=True, timeout=60)
        return done.stdout

    checked = ask("mcap", "check", tmp_path / "out.mcap")
    assert checked.count("\nok ") == len(read_mcap(tmp_path / "out.mcap"))
    ask("mcap", "convert", tmp_path / "out.mcap", "-o", tmp_path / "out.rrd")
    from rerun.chunk import RrdReader  # noqa: PLC0415 - it takes its time

    found = {}
    for chunk in RrdReader(str(tmp_path / "out.rrd")).stream():
        for field in chunk.to_record_batch().schema:
            found[f"{chunk.entity_path}:{field.name}"] = field.type
    status = found["/can0/node_11/ESCStatus:tailbyte.ESCStatus:message"].value_type
    assert status.field("voltage").type == pa.float32()
    assert status.field("rpm").type == pa.int32()
    assert "/can0/events:TextLog:text" in found
