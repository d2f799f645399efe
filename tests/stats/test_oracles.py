"""Statistics beside what others make of the same capture: tshark, and pandas over the decoded tables."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from kit import ROOT, encode
from kit.traffic import SECOND, START, lines

import analyzer
from analyzer.cli import main
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from pathlib import Path

LIMIT = 1800
LOGS = ["captures/hover.log", "captures/mission-8-faults.log", "captures/services.log"]
# Filters whose fields tshark has, too.
SAME = ["can.len>=4", "can.id & 0x80", "can.flags.rtr==0", "can.id == 0x1004060a || can.len < 3", "frame.number > 700"]


def tshark(path: Path, statistic: str) -> str:
    done = subprocess.run(
        ["tshark", "-r", path, "-q", "-z", statistic], capture_output=True, timeout=LIMIT, check=True, text=True
    )
    return done.stdout


@pytest.mark.sampled(4)
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
@pytest.mark.parametrize("name", LOGS)
def test_tshark_counts_the_same(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    assert main(["convert", str(ROOT / name), "-o", str(path)]) == 0
    asked = ",".join(["io,stat,0.5", "frame", "SUM(can.len)can.len && can.flags.rtr==0", *SAME])
    shown = []
    for line in tshark(path, asked).splitlines():
        if re.match(r"\|\s*[\d.]+ <>", line):
            _, _, frames, _, size, *rest, _ = (cell.strip() for cell in line.split("|"))
            shown.append([int(frames), int(size), *map(int, rest[::2])])
    ours = analyzer.open_capture(path).stats(",".join(["io", "0.5", *SAME]))
    assert ours.column_names[5:] == SAME
    columns = [ours.column(k).to_pylist() for k in (2, 3, *range(5, 5 + len(SAME)))]
    assert [list(row) for row in zip(*columns, strict=True)] == shown
    protocols = re.search(r"^can .*frames:(\d+)", tshark(path, "io,phs"), re.MULTILINE)
    assert protocols is not None
    assert sum(row[0] for row in shown) == int(protocols[1])


def frames_of(name: str) -> pd.DataFrame:
    frames = analyzer.open_capture(ROOT / name).table("frames").to_pandas()
    return frames.assign(size=frames.data.map(len), at=frames.t.astype("int64"))


def test_talkers_are_groups_of_transfers() -> None:
    capture = analyzer.open_capture(ROOT / "captures/faults.log")
    transfers = capture.table("transfers").to_pandas()
    sizes = frames_of("captures/faults.log")["size"].to_numpy()
    transfers["frames"] = transfers.frame.map(len)
    transfers["bytes"] = transfers.frame.map(lambda of: int(sizes[of.astype(np.int64)].sum()))
    expected = transfers.groupby(["src", "kind", "type_id"]).agg(
        transfers=("frames", "size"), frames=("frames", "sum"), bytes=("bytes", "sum")
    )
    ours = capture.stats("talkers").to_pandas()
    ours = ours[ours.node.notna()]
    counts = sorted(
        map(
            tuple,
            expected.reset_index()
            .assign(kind=lambda t: t.kind.map(KINDS.__getitem__))
            .to_numpy()[:, [0, 1, 3, 4, 5]]
            .tolist(),
        )
    )
    columns = zip(ours.node.astype(int), ours.kind, ours.transfers.astype(int), ours.frames, ours.bytes, strict=True)
    assert sorted(columns) == counts


def test_periods_are_differences_of_times() -> None:
    capture = analyzer.open_capture(ROOT / "captures/mission-8-faults.log")
    transfers = capture.table("transfers").to_pandas()
    at = transfers.t.astype("int64")
    messages = transfers[transfers.kind == 0].assign(at=at - at.min()).sort_values("at")
    gaps = messages.groupby(["src", "type_id"])["at"].diff().dropna() / 1e6
    by = gaps.groupby([messages.src, messages.type_id])
    expected = pd.DataFrame({
        "count": by.size() + 1, "median": by.median(), "p99": by.quantile(0.99), "worst": by.max(),
        "jitter": (by.quantile(0.95) - by.quantile(0.05)) / 2,
    })  # fmt: skip
    expected.loc[expected["count"] < 4, ["p99", "jitter"]] = np.nan  # a time or two are not spread
    ours = capture.stats("periods").to_pandas()
    got = ours[["count", "median_ms", "p99_ms", "worst_ms", "jitter_ms"]].to_numpy()
    assert list(map(int, ours.node)) == expected.index.get_level_values(0).tolist()
    # More values than are kept are counted in buckets: RawCommand at 400 Hz.
    np.testing.assert_allclose(got, expected.to_numpy(), rtol=0.0051, atol=0.02)
    few = expected["count"].to_numpy() < 1000
    assert 0 < few.sum() < len(few)
    np.testing.assert_allclose(got[few], expected.to_numpy()[few], rtol=1e-6, atol=1e-6)


def test_values_are_groups_of_a_column() -> None:
    capture = analyzer.open_capture(ROOT / "captures/hover-4.log")
    esc = capture.table("ESCStatus").to_pandas()
    by = esc[esc.trusted].groupby(["src", "esc_index"])["voltage"]
    expected = pd.DataFrame({
        "count": by.size(), "min": by.min(), "mean": by.mean(), "p50": by.quantile(0.5), "p95": by.quantile(0.95),
        "p99": by.quantile(0.99), "max": by.max(),
    })  # fmt: skip
    ours = capture.stats("values,ESCStatus.voltage").to_pandas()
    assert [(int(node), device) for node, device in zip(ours.node, ours.device, strict=True)] == [
        (src, f"ESC {index + 1}") for src, index in expected.index
    ]
    np.testing.assert_allclose(ours[expected.columns].to_numpy(), expected.to_numpy(), rtol=1e-6)
    fast = capture.filter("ESCStatus.rpm > 2000").stats("values,ESCStatus.voltage").to_pandas()
    wanted = esc[esc.rpm > 2000].groupby("src")["voltage"].agg(["size", "min"])
    assert fast[["count", "min"]].to_numpy().tolist() == wanted.to_numpy().tolist()


def test_io_measures_are_groups_of_time() -> None:
    name = "captures/hover-4.log"
    capture = analyzer.open_capture(ROOT / name)
    first = frames_of(name)["at"].iloc[0]
    esc = capture.table("ESCStatus").to_pandas()
    esc = esc.assign(slot=(esc.t.astype("int64") - first) // 500_000_000)
    by = esc.groupby("slot")["voltage"]
    ours = capture.stats("io,500ms,COUNT(ESCStatus.voltage),AVG(ESCStatus.voltage),MIN(ESCStatus.voltage)"
                         ",MAX(ESCStatus.rpm)node == 12,ESCStatus").to_pandas()  # fmt: skip
    expected = pd.DataFrame({"count": by.size(), "avg": by.mean(), "min": by.min()})
    np.testing.assert_allclose(ours.iloc[:, 5:8].to_numpy(float), expected.to_numpy(float), rtol=1e-6)
    assert ours.iloc[:, 8].tolist() == esc[esc.src == 12].groupby("slot")["rpm"].max().tolist()
    frames = frames_of(name)
    is_esc: Any = (frames.id // 256 % 65536 == 1034) & (frames.id & 0x80 == 0)
    slots = (frames["at"] - first) // 500_000_000
    assert ours.iloc[:, 9].tolist() == is_esc.groupby(slots).sum().tolist()
    assert ours.bytes.tolist() == frames["size"].groupby(slots).sum().tolist()


def test_services_are_pairs() -> None:
    """Answered by the first response of a transfer ID that began at most 2 s later."""
    capture = analyzer.open_capture(ROOT / "captures/services.log")
    transfers = capture.table("transfers").to_pandas()
    asked, answers = (transfers[transfers.kind == kind] for kind in (2, 3))
    delays: dict[tuple[int, int], list[float]] = {}
    for one in asked.itertuples():
        mine = answers[(answers.src == one.dst) & (answers.dst == one.src) & (answers.type_id == one.type_id)]
        mine = mine[(mine.transfer_id == one.transfer_id) & (mine.t >= one.t)]
        delays.setdefault((one.dst, one.type_id), []).append((mine.t_end.iloc[0] - one.t_end) / np.timedelta64(1, "ms"))
    ours = capture.stats("services").to_pandas()
    expected = sorted((len(some), min(some), float(np.median(some)), max(some)) for some in delays.values())
    got = sorted(zip(ours.answered, ours.min_ms, ours.median_ms, ours.max_ms, strict=True))
    np.testing.assert_allclose(got, expected)
    assert ours.requests.tolist() == ours.answered.tolist()


def test_packets_of_one_transfer_may_speak_of_several_units(tmp_path: Path) -> None:
    parts = [
        encode.packet("PUSHCAN.MotorStatus", n, 0xA1 + unit, speed=100 * (unit + 1) + n)
        for n in range(3)
        for unit in range(2)
    ]
    frames = [
        frame
        for n in range(3)
        for frame in encode.transfer(
            "PUSHCAN", {"data_sequence": n, "data": list(b"".join(parts[2 * n : 2 * n + 2]))}, 20, n
        ).frames(START + n * SECOND)
    ]
    path = tmp_path / "two.log"
    path.write_bytes(lines(frames))
    ours = analyzer.open_capture(path).stats("values,PUSHCAN.MotorStatus.speed").to_pandas()
    assert ours[["node", "device", "count", "min", "max"]].to_numpy().tolist() == [
        ["20", "unit 1", 3, 100.0, 102.0],
        ["20", "unit 2", 3, 200.0, 202.0],
    ]
