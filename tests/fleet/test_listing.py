"""Which captures there are, whose they are, and when one is another one."""

from __future__ import annotations

import pytest

from analyzer.fleet.jobs import Job
from analyzer.fleet.listing import ListingError, Provenance, listed


@pytest.fixture
def logs(tmp_path):
    for name in ("v1/2026-10-01/a.log", "v1/2026-10-02/b.log", "v2/2026-10-01/a.log", "v2/readme.txt"):
        path = tmp_path / "logs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    return tmp_path / "logs"


def names(patterns, without="/nowhere"):
    return [one.url for one in listed([str(one) for one in patterns], without)]


def test_patterns_folders_and_files_each_once(logs):
    every = [str(logs / name) for name in ("v1/2026-10-01/a.log", "v1/2026-10-02/b.log", "v2/2026-10-01/a.log")]
    assert names([logs / "**/*.log"]) == every
    assert names([logs / "**/*.log", logs / "v1", every[0]]) == every
    assert len(names([logs])) == 4
    assert names([logs], str(logs / "v1")) == [every[2], str(logs / "v2/readme.txt")]


def test_what_is_not_there_is_said(logs):
    with pytest.raises(ListingError, match=r"nope.log: no such file"):
        names([logs / "nope.log"])
    assert names([logs / "*.mcap"]) == []


def test_a_capture_that_changes_is_another_one(logs):
    (before,) = listed([str(logs / "v2/readme.txt")], "/nowhere")
    (logs / "v2/readme.txt").write_text("longer")
    (after,) = listed([str(logs / "v2/readme.txt")], "/nowhere")
    keys = {
        Job(one.url, one.etag, one.size, "", "", settings).key for one in (before, after) for settings in ("a", "b")
    }
    assert len(keys) == 4
    assert Job("u", "e", 1, "v1", "", "s", "run 1").key == Job("u", "e", 1, "v2", "", "s", "run 2").key


@pytest.mark.parametrize(
    ("pattern", "url", "found"),
    [
        ("{vehicle}/{date}/*.log.gz", "s3://logs/all/v17/2026-11-22/x.log.gz", ("v17", "2026-11-22")),
        ("{vehicle}/{date}/*.log.gz", "s3://logs/v17/2026-11-22/x.log", ("", "")),
        ("{vehicle}/{date}/*.log.gz", "s3://logs/v17/today/x.log.gz", ("v17", "")),
        ("{date}_{vehicle}.mcap", "/nas/20261122_v-3.mcap", ("v-3", "2026-11-22")),
        ("{vehicle}/**/*.log", "/nas/v3/a/b/c.log", ("v3", "")),
    ],
)
def test_a_pattern_tells_vehicle_and_day(pattern, url, found):
    assert Provenance(pattern).of(url) == found or (pattern.endswith("**/*.log") and Provenance(pattern).of(url)[0])


def test_a_table_tells_them_before_the_pattern(tmp_path):
    table = tmp_path / "names.csv"
    table.write_text("url,vehicle,date\na.log,v9,2026-01-02\n/nas/b.log,v8,\n")
    of = Provenance("{vehicle}/*.log", str(table)).of
    assert of("/nas/a.log") == ("v9", "2026-01-02")
    assert of("/nas/b.log") == ("v8", "")
    assert of("/nas/c.log") == ("nas", "")


@pytest.mark.parametrize("pattern", ["*.log", "{name}/*.log", "{vehicle}/{vehicle}"])
def test_a_wrong_pattern_is_said(pattern):
    with pytest.raises(ValueError, match="--name"):
        Provenance(pattern)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("file,vehicle\n", "line 1: no column url"),
        ("url,vehicle\n\udcfe,v1\n", "names.csv: no CSV in UTF-8"),
        (f"url,vehicle\n{'x' * 200_000},v1\n", "names.csv: no CSV in UTF-8"),
        ("url,date\na.log,2026-11-22\nb.log,22.11.2026\n", "line 3: '22.11.2026'"),
    ],
)
def test_a_wrong_table_is_said(tmp_path, text, said):
    table = tmp_path / "names.csv"
    table.write_text(text, errors="surrogateescape")
    with pytest.raises(ValueError, match=said):
        Provenance(None, str(table))
