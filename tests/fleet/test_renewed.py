"""What is done counts again as it is asked for: with settings of before, of vehicles that are told later."""

from __future__ import annotations

from kit.fleets import GOOD, checked, content, logs  # noqa: F401 - fixtures

from analyzer.fleet.store import ResultStore


def test_whose_a_capture_is_may_be_told_later(checked, logs, command):  # noqa: F811
    place, arguments = checked
    before = content(ResultStore(str(place)))
    names = logs.parent / "names.csv"
    names.write_text("url,vehicle,date\nv0_hover.log.gz,alpha,2026-01-02\nv4_control-lost.log.gz,beta,\n")
    again = [*arguments[:5], "--names", names, "--workers", "0"]
    status, _, said = command(*again)
    assert (status, "10 done before" in said, "-- 10 of those done before are of another vehicle" in said) == (
        0,
        True,
        True,
    )
    store = ResultStore(str(place))
    told = dict(
        store.connected().execute("select regexp_extract(url, '[^/]*$'), (vehicle, date) from latest").fetchall()
    )
    assert told["v0_hover.log.gz"] == ("alpha", "2026-01-02")
    assert told["v4_control-lost.log.gz"] == ("beta", "2026-03-14")
    assert told["v1_hover-4.log.gz"] == ("", "2026-03-14")
    after = content(store)
    assert {name: len(rows) for name, rows in after.items()} == {name: len(rows) for name, rows in before.items()}
    assert "another vehicle" not in command(*again)[2]
    assert "another vehicle" not in command(*arguments[:5], "--workers", "0")[2]  # untold is not told otherwise
    assert content(store) == after
    command(*arguments)
    assert content(store) == before


def test_settings_that_are_asked_for_again_count_again(checked, command):  # noqa: F811
    place, arguments = checked
    before = content(ResultStore(str(place)))
    assert "0 done before" in command(*arguments, "--select", "TRF-003")[2]
    other = content(ResultStore(str(place)))
    assert other["rules"] != before["rules"]
    for more, wanted in (([], before), (["--select", "TRF-003"], other), ([], before), ([], before)):
        said = command(*arguments, *more)[2]
        assert "10 done before" in said
        assert "another vehicle" not in said
        assert content(ResultStore(str(place))) == wanted


def test_captures_that_a_pattern_does_not_fit_are_told(logs, tmp_path, command):  # noqa: F811
    for number, folder in enumerate(("v1/2026-10-01", "v1", ".")):
        place = tmp_path / "named" / folder
        place.mkdir(parents=True, exist_ok=True)
        (place / "flight.log.gz").write_bytes((logs / f"v{number}_{GOOD[number]}.log.gz").read_bytes())
    arguments = ["fleet", "check", tmp_path / "named", "-o", tmp_path / "results", "--workers", "0"]
    name = "named/{vehicle}/{date}/*.gz"
    _, _, said = command(*arguments, "--name", name)
    assert f"--name {name!r} tells the vehicle of 1 of 3 captures, not of {tmp_path}/named/flight.log.gz\n" in said
    name = "{vehicle}/{date}/*.gz"
    _, _, said = command(*arguments, "--name", name)
    odd = f"{tmp_path}/named/flight.log.gz, of vehicle {tmp_path.name}"
    assert f"--name {name!r} finds no day in 2 of 3 captures, such as {odd}\n" in said


def test_an_export_follows_what_is_told_of_captures(logs, tmp_path, command):  # noqa: F811
    place = tmp_path / "tables"
    arguments = ["fleet", "export", logs / "v0_hover.log.gz", "-o", place, "--table", "ESCStatus", "--workers", "0"]
    for more, folder in (
        ([], "."), (["--partition", "vehicle"], "vehicle=unknown"),
        (["--partition", "vehicle", "--name", "{vehicle}_*.log.gz"], "vehicle=v0"),
        (["--partition", "date,vehicle", "--name", "{vehicle}_*.log.gz"], "date=unknown/vehicle=v0"), ([], "."),
    ):  # fmt: skip
        assert "captures: 1 read, 0 done before" in command(*arguments, *more)[2]
        (path,) = (place / "ESCStatus").rglob("*.parquet")
        assert path.parent == place / "ESCStatus" / folder
        assert "captures: 0 read, 1 done before" in command(*arguments, *more)[2]
