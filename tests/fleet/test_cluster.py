"""A real cluster of two workers: workers and drivers that are killed change nothing in what is found."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import fsspec
import pytest
from kit.command import wait_until
from kit.fleets import QUICK, SETTINGS, content, logs  # noqa: F401 - a fixture
from moto.server import ThreadedMotoServer

from analyzer.fleet.cluster import ClusterChoice, Serial, cluster
from analyzer.fleet.driver import FleetRun, jobs_of
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.store import ResultStore

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # of libraries, about sockets of workers that were killed
]
_DRIVER = """
import sys
from analyzer.fleet import driver
from analyzer.fleet.cluster import ClusterChoice, cluster
from analyzer.fleet.jobs import FleetSettings, Retries
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.store import ResultStore

def told(counts):
    print(counts.done, flush=True)

if __name__ == "__main__":
    driver.COMMIT_CAPTURES = 2
    store, settings = ResultStore(sys.argv[2]), FleetSettings()
    jobs = driver.jobs_of(listed([sys.argv[1]], store.place), Provenance(), settings.digest())
    with store.alone(), cluster(ClusterChoice(workers=2)) as workers:
        driver.FleetRun(store, settings, Retries(2, 0.01), told).over(jobs, workers)
"""


def jobs_in(place, store):
    return jobs_of(listed([str(place)], store.place), Provenance(), SETTINGS.digest())


@pytest.fixture
def serial(logs, tmp_path):  # noqa: F811 - pytest's way
    store = ResultStore(str(tmp_path / "serial"))
    FleetRun(store, SETTINGS, QUICK).over(jobs_in(logs, store), Serial())
    return content(store)


@pytest.mark.proof
def test_a_worker_that_is_killed_changes_nothing(logs, tmp_path, serial):  # noqa: F811
    store = ResultStore(str(tmp_path / "results"))
    with cluster(ClusterChoice(workers=2)) as workers:
        pids = list(workers._client.run(os.getpid).values())
        assert set(workers._client.run(os.getenv, "MALLOC_ARENA_MAX").values()) == {"1"}  # of all their threads

        def told(counts):
            if counts.done == 2:
                os.kill(pids[0], signal.SIGKILL)

        run = FleetRun(store, SETTINGS, QUICK, told)
        run.over(jobs_in(logs, store), workers)
    assert run.counts.done == run.counts.listed
    assert content(store) == serial
    assert len(store.opened("captures").to_pyarrow_table()) == run.counts.listed


def test_a_capture_that_kills_its_worker_is_an_error_and_no_more(logs, tmp_path, serial):  # noqa: F811
    store = ResultStore(str(tmp_path / "results"))

    class Deadly:
        """Workers that die of one capture."""

        def __init__(self, workers):
            self.workers, self._of = workers.workers, workers

        def results(self, jobs, work):
            def deadly(some):
                if any("v0_again" in job.url for job in some):
                    os.kill(os.getpid(), signal.SIGKILL)
                return work(some)

            return self._of.results(jobs, deadly)

    with cluster(ClusterChoice(workers=2)) as workers:
        FleetRun(store, SETTINGS, QUICK).over(jobs_in(logs, store), Deadly(workers))
    answers = store.connected()
    rows = answers.execute("select url, outcome, verdict, error from latest where outcome = 'killed'").fetchall()
    assert [(url.rpartition("/")[2], *rest) for url, *rest in rows] == [
        ("v0_again.log.gz", "killed", None, "its worker died of it, alone again")
    ]
    assert len(content(store)["captures"]) == len(serial["captures"])
    assert ResultStore.done(store, retry=False) - ResultStore.done(store, retry=True) != set()


@pytest.mark.proof
def test_a_driver_that_is_killed_is_gone_on_with(logs, tmp_path, serial):  # noqa: F811
    store, script = ResultStore(str(tmp_path / "results")), tmp_path / "driver.py"
    script.write_text(_DRIVER)
    with subprocess.Popen(
        [sys.executable, str(script), str(logs), store.place], stdout=subprocess.PIPE, text=True
    ) as driver:
        assert driver.stdout is not None
        for line in driver.stdout:
            if int(line) == 5:
                os.kill(driver.pid, signal.SIGKILL)
                break
    done = store.done(retry=False)
    assert 4 <= len(done) < len(serial["captures"])
    run = FleetRun(store, SETTINGS, QUICK)
    with store.alone(), cluster(ClusterChoice(workers=2)) as workers:
        run.over(jobs_in(logs, store), workers)
    assert run.counts.skipped == len(done)
    assert content(store) == serial


def test_ctrl_c_on_a_terminal_is_told_in_plain_lines(logs, tmp_path):  # noqa: F811
    """The terminal sends it to all processes at once, here as the first worker starts."""
    arguments = ["fleet", "check", str(logs), "-o", str(tmp_path / "results"), "--workers", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "analyzer", *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        wait_until(lambda: any(b"spawn_main" in command_of(pid) for pid in group(run.pid)))
        os.killpg(run.pid, signal.SIGINT)
        _, said = run.communicate(timeout=60)
    assert run.returncode == 130
    assert [line for line in said.splitlines() if not line.startswith("-- ")] == [], said
    assert "interrupted: the same command goes on" in said
    wait_until(lambda: not group(run.pid))


def group(number):
    """Return the processes of a group."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError):
            if int((place / "stat").read_text().rpartition(")")[2].split()[2]) == number:
                found.append(int(place.name))
    return found


def command_of(pid):
    """Return the arguments of a process; nothing if it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@pytest.fixture
def storage(monkeypatch):
    """Return the address of a bucket of S3, on the loopback."""
    server = ThreadedMotoServer("127.0.0.1", 0)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_REGION": "us-east-1", "AWS_DEFAULT_REGION": "us-east-1", "AWS_ALLOW_HTTP": "true",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    fsspec.get_filesystem_class("s3").clear_instance_cache()  # what is kept knows the server of another test
    files = fsspec.filesystem("s3", skip_instance_cache=True)
    files.mkdir("fleet")
    yield "s3://fleet", files
    files.rm("fleet", recursive=True)  # moto keeps buckets for the next server of this process
    server.stop()


@pytest.mark.proof
def test_captures_and_results_in_a_storage(logs, storage, command):  # noqa: F811
    place, files = storage
    for path in logs.iterdir():
        files.put_file(str(path), f"fleet/logs/{path.name}")
    alone, both = ResultStore(f"{place}/alone"), ResultStore(f"{place}/both")
    patterns = [f"{place}/logs/*.gz"]
    jobs = jobs_of(listed(patterns, both.place), Provenance(), SETTINGS.digest())
    FleetRun(alone, SETTINGS, QUICK).over(jobs, Serial())
    with cluster(ClusterChoice(workers=2)) as workers:
        FleetRun(both, SETTINGS, QUICK).over(jobs, workers)
    assert content(alone) == content(both)
    assert {one[1] for one in content(both)["captures"]} == {job.url for job in jobs}
    run = FleetRun(both, SETTINGS, QUICK)
    run.over(jobs, Serial())
    assert (run.counts.skipped, run.counts.done) == (len(jobs), 0)
    assert command("triage", f"{place}/logs/v4_control-lost.log.gz")[0] == 0
    status, _, said = command("triage", f"{place}/logs/gone.log.gz")
    assert (status, said.count("\n")) == (3, 1), said


def test_two_commands_at_once_on_a_storage(logs, storage):  # noqa: F811
    """Two real processes write one store: Delta's conditional writes keep every commit of both."""
    place, files = storage
    for name in ("v0_hover", "v1_cut", "v3_empty", "v4_control-lost"):
        files.put_file(str(logs / f"{name}.log.gz"), f"fleet/logs/{name}.log.gz")
    arguments = ["fleet", "check", f"{place}/logs/*.gz", "-o", f"{place}/both", "--workers", "0"]
    with (
        subprocess.Popen([sys.executable, "-m", "analyzer", *arguments], stderr=subprocess.PIPE, text=True) as one,
        subprocess.Popen([sys.executable, "-m", "analyzer", *arguments], stderr=subprocess.PIPE, text=True) as two,
    ):
        told = [each.communicate()[1] for each in (one, two)]
    assert [one.returncode, two.returncode] == [0, 0], told
    alone, both = ResultStore(f"{place}/alone"), ResultStore(f"{place}/both")
    jobs = jobs_of(listed([f"{place}/logs/*.gz"], both.place), Provenance(), SETTINGS.digest())
    FleetRun(alone, SETTINGS, QUICK).over(jobs, Serial())
    assert content(both) == content(alone)
    runs = both.connected().execute("select ended, done + skipped from runs").fetchall()
    assert runs == [("done", len(jobs))] * 2


def test_a_scheduler_of_its_own(logs, tmp_path, serial, command):  # noqa: F811
    """Scheduler and worker as they are started on other machines, by Dask's own commands."""
    run = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    scheduler = subprocess.Popen([*run, "--no-dashboard"], stderr=subprocess.PIPE, text=True)
    worker = None
    try:
        assert scheduler.stderr is not None
        address = next(line for line in scheduler.stderr if "Scheduler at" in line).split()[-1]
        run = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--no-nanny",
        ]
        worker = subprocess.Popen([*run, "--host", "127.0.0.1"], stderr=subprocess.PIPE, text=True)
        assert worker.stderr is not None
        next(line for line in worker.stderr if "Registered to" in line)
        store = ResultStore(str(tmp_path / "results"))
        status, _, said = command("fleet", "check", logs, "-o", store.place, "--scheduler", address)
        assert (status, "on 1 workers" in said) == (3, True), said
        assert content(store) == serial
    finally:
        for one in (worker, scheduler):
            if one is not None:
                one.terminate()
                one.wait()


def test_a_scheduler_that_is_not_there(command, logs, tmp_path):  # noqa: F811
    arguments = ["fleet", "check", logs, "-o", tmp_path / "results", "--scheduler", "nope://127.0.0.1:1"]
    status, _, said = command(*arguments)
    assert (status, "nope://127.0.0.1:1" in said) == (3, True), said
