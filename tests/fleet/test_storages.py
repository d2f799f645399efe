"""Captures in storages, each played on the loopback: listed, read as streams, judged as files are, and known again."""

from __future__ import annotations

import importlib
import json
import sys
from collections import Counter
from types import SimpleNamespace

import fsspec
import paramiko
import pytest
from kit import CAPTURES
from kit.fleets import QUICK, SETTINGS, content, logs  # noqa: F401 - a fixture
from kit.sftp import serving_ssh
from kit.storages import serving

from analyzer.fleet.cluster import Serial
from analyzer.fleet.driver import FleetRun, jobs_of
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.store import ResultStore, StoreError
from analyzer.fleet.tables import TABLES, rows_table

pytestmark = pytest.mark.filterwarnings("ignore")  # of libraries, about sockets that they leave open
KINDS = ("web", "google", "azure", "ssh")


@pytest.fixture(params=KINDS)
def storage(request, tmp_path, monkeypatch):
    """Return files that may be changed, and the address of the folder in which they are."""
    fsspec.core.filesystem("memory").clear_instance_cache()
    files = {}
    if request.param == "ssh":
        yield from _ssh(tmp_path, monkeypatch)
        return
    with serving(request.param, files) as port:
        at = f"http://127.0.0.1:{port}"
        _known(at, tmp_path, monkeypatch)
        yield files, {"web": f"{at}/all", "google": "gs://logs/all", "azure": "az://logs/all"}[request.param]


def _known(at, place, monkeypatch):
    """Have fsspec and Delta ask this server for Google's storage, and for Azure's."""
    account = place / "account.json"
    account.write_text(json.dumps({
        "gcs_base_url": at, "disable_oauth": True, "client_email": "", "private_key": "", "private_key_id": "",
    }))  # fmt: skip
    for name, value in {
        "STORAGE_EMULATOR_HOST": at,
        "GOOGLE_SERVICE_ACCOUNT": str(account),
        "AZURE_STORAGE_CONNECTION_STRING": "DefaultEndpointsProtocol=http;AccountName=devstoreaccount1;"
        f"AccountKey=c2VjcmV0;BlobEndpoint={at}/devstoreaccount1;",
        "AZURE_STORAGE_USE_EMULATOR": "true",
        "AZURE_STORAGE_ACCOUNT_NAME": "devstoreaccount1",
        "AZURITE_BLOB_STORAGE_URL": at,
    }.items():
        monkeypatch.setenv(name, value)


class _Folder(dict):
    """Files by name that lie in a folder, too."""

    def __init__(self, folder):
        super().__init__()
        self._folder = folder

    def __setitem__(self, name, data):
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        super().__setitem__(name, data)


def _ssh(tmp_path, monkeypatch):
    home = tmp_path / "home/.ssh"
    home.mkdir(parents=True)
    paramiko.RSAKey.generate(2048).write_private_key_file(str(home / "id_rsa"))
    monkeypatch.setenv("HOME", str(home.parent))
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)
    with serving_ssh(tmp_path / "remote") as port:
        yield _Folder(tmp_path / "remote"), f"ssh://pilot@127.0.0.1:{port}/all"


def over(pattern, store):
    fsspec.get_filesystem_class(pattern.partition(":")[0]).clear_instance_cache()
    run = FleetRun(store, SETTINGS, QUICK)
    run.over(jobs_of(listed([pattern], store.place), Provenance("{vehicle}_*.log.gz"), SETTINGS.digest()), Serial())
    return run.counts


@pytest.mark.slow
def test_captures_of_a_storage(storage, logs, tmp_path, command):  # noqa: F811 - pytest's way
    files, place = storage
    picked = ("v0_hover.log.gz", "v1_cut.log.gz", "v2_garbage.log.gz")
    for name in picked:
        files[f"all/{name}"] = (logs / name).read_bytes()
    store, here = ResultStore(str(tmp_path / "results")), ResultStore(str(tmp_path / "here"))
    counts = over(f"{place}/*.gz", store)
    assert (counts.done, counts.failed, counts.unavailable) == (3, 1, 0)
    for name in picked:
        run = FleetRun(here, SETTINGS, QUICK)
        run.over(jobs_of(listed([str(logs / name)], here.place), Provenance(), SETTINGS.digest()), Serial())
    mine, its = (
        answers.connected()
        .execute("select sha256, outcome, verdict, frames, transfers from latest order by 1")
        .fetchall()
        for answers in (here, store)
    )
    assert its == mine
    for table in ("findings", "esc_health", "events"):
        assert Counter(row[1:] for row in content(store)[table]) == Counter(row[1:] for row in content(here)[table])
    assert {one[0] for one in store.connected().execute("select url from latest").fetchall()} == {
        f"{place}/{name}" for name in picked
    }
    again = over(f"{place}/*.gz", store)
    assert (again.skipped, again.done) == (3, 0)
    files["all/v2_garbage.log.gz"] = (logs / "v4_control-lost.log.gz").read_bytes()
    changed = over(place, store)  # the folder, without a pattern
    assert (changed.skipped, changed.done, changed.failed) == (2, 1, 0)
    assert command("triage", f"{place}/v2_garbage.log.gz")[0] == 0
    status, _, said = command("triage", f"{place}/gone.log.gz")
    assert (status, said.count("\n")) == (3, 1), said


@pytest.mark.slow
@pytest.mark.parametrize("storage", ["google", "azure"], indirect=True)
def test_results_in_a_storage(storage, logs, tmp_path, command):  # noqa: F811
    files, place = storage
    for name in ("v0_hover.log.gz", "v1_cut.log.gz", "v5_faults.log.gz"):
        files[f"all/{name}"] = (logs / name).read_bytes()
    store, here = ResultStore(place.replace("/all", "/results")), ResultStore(str(tmp_path / "here"))
    for one in (store, here):
        over(f"{place}/*.gz", one)
    assert content(store) == content(here)
    again = over(f"{place}/*.gz", store)
    assert (again.skipped, again.done) == (3, 0)
    files["all/v0_hover.log.gz"] = (logs / "v4_control-lost.log.gz").read_bytes()
    assert over(f"{place}/*.gz", store).done == 1
    before = content(store)
    assert command("fleet", "compact", store.place)[0] == 0
    assert content(store) == before
    assert command("fleet", "report", store.place)[1].startswith(f"Fleet {store.place}")


@pytest.mark.slow
@pytest.mark.parametrize("storage", ["google", "azure"], indirect=True)
def test_two_drivers_of_a_storage_keep_each_other_s_commits(storage):
    """Each knows the table as it was before the other one wrote."""
    _, place = storage
    one, other = (ResultStore(place.replace("/all", "/results")) for _ in range(2))
    one.append({"runs": [rows_table("runs", [_run("first")])]})
    other.append({"runs": [rows_table("runs", [_run("second")])]})
    one.append({"runs": [rows_table("runs", [_run("third")])]})
    other.append({"runs": [rows_table("runs", [_run("fourth")])]})
    found = one.connected().execute("select run from runs order by 1").fetchall()
    assert [run for (run,) in found] == ["first", "fourth", "second", "third"]


def _run(name):
    return {**dict.fromkeys(TABLES["runs"].names), "key": "", "run": name}


@pytest.mark.parametrize(
    ("place", "package"), [("gs://logs/*", "gcsfs"), ("az://logs/*", "adlfs"), ("sftp://nas/logs/*", "paramiko")]
)
def test_a_storage_whose_package_is_missing(place, package, command, monkeypatch, tmp_path):
    real = importlib.import_module

    def without(name, *more):
        if package in name or (package == "paramiko" and "sftp" in name):
            raise ImportError(f"No module named {package!r}")
        return real(name, *more)

    registry = sys.modules["fsspec.registry"]
    monkeypatch.setattr(registry, "importlib", SimpleNamespace(import_module=without))
    monkeypatch.delitem(registry._registry, place.partition(":")[0], raising=False)
    status, _, said = command("fleet", "check", place, "-o", tmp_path / "results", "--workers", "0")
    assert (status, place in said, package in said, said.count("\n")) == (3, True, True, 1), said


@pytest.mark.parametrize("place", ["ssh://pilot:hush@nas/logs/*", "https://pilot:hush@nas/logs/x.log"])
def test_a_password_in_an_address_is_refused_and_not_repeated(place, command, tmp_path):
    for arguments in (("check", place, "-o", tmp_path), ("status", place)):
        status, shown, said = command("fleet", *arguments)
        assert (status, said.count("\n"), "hush" in shown + said) == (2, 1, False), said
        assert "password" in said


@pytest.mark.parametrize("place", ["ssh://nas/results", "https://nas/results", "nope://nas/results"])
def test_a_store_where_tables_cannot_be_written(place, command):
    status, _, said = command("fleet", "status", place)
    assert (status, said.count("\n"), place in said) == (2, 1, True), said


def test_a_storage_that_does_not_answer_is_told_in_one_plain_line(command, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")  # which Delta does not even ask: it is not https
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "a")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "hidden")
    code, out, err = command("fleet", "check", CAPTURES / "hover-4.log", "-o", "s3://logs/results")
    assert (code, out) == (3, "")
    (line,) = err.splitlines()
    assert line.startswith("tailbyte fleet: s3://logs/results/captures: ")
    assert "Error performing GET http://127.0.0.1:9/logs/results/captures/" in line
    assert [word for word in ("\\x", "\x1b", "↳", "OSError", "hidden") if word in line] == []


def test_what_stands_behind_an_address_may_be_a_key_and_is_not_repeated(monkeypatch):
    def refuse(*_):
        raise OSError("no\n\x1b[31m  ↳\x1b[0m GET https://fleet.test/a?sig=hidden&se=1 failed: what now?")

    monkeypatch.setattr("deltalake.DeltaTable", refuse)
    with pytest.raises(StoreError) as caught:
        ResultStore("s3://logs/results").opened("captures")
    assert str(caught.value) == "s3://logs/results/captures: no: GET https://fleet.test/a failed: what now?"
