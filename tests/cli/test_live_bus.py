"""`tailbyte live` on python-can's virtual bus: what is shown, recorded and judged is what was sent."""

from __future__ import annotations

import json
import threading
from typing import TYPE_CHECKING

import can
import pytest
from kit.command import CAPTURES, wait_until

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration")
FAULTY = CAPTURES / "mission-8-faults.log"


def messages(path: Path) -> list[can.Message]:
    """The frames of a candump log with their times."""
    with can.LogReader(path) as log:
        return [message for message in log if not message.is_error_frame]


@pytest.fixture
def sent() -> Iterator[Callable[[Sequence[can.Message]], None]]:
    """Sends once somebody listens on `virtual:here`, with the times that the messages have."""
    threads: list[threading.Thread] = []

    def send(all_: Sequence[can.Message]) -> None:
        def work() -> None:
            with can.Bus("here", interface="virtual", ignore_config=True, preserve_timestamps=True) as bus:
                wait_until(lambda: len(bus.channel) == 2)
                for message in all_:
                    bus.send(message)

        threads.append(threading.Thread(target=work))
        threads[-1].start()

    yield send
    for thread in threads:
        thread.join()


def findings(path: Path) -> bytes:
    return json.dumps(json.loads(path.read_bytes())["findings"]).encode()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x.log", "x.mcap", "x.pcapng", "x.log.gz"])
def test_the_findings_are_those_of_check_on_the_recording(
    name: str, command: Command, sent: Callable[..., None], tmp_path: Path
) -> None:
    frames = messages(FAULTY)
    sent(frames)
    record, live, checked = tmp_path / name, tmp_path / "live.json", tmp_path / "check.json"
    status, _, err = command("live", "virtual:here", "-q", "-c", len(frames), "-w", record, "--json", live)
    assert f"{len(frames):,} received + 0 dropped" in err
    assert command("check", record, "--json", checked)[0] == status == 1
    assert findings(live) == findings(checked)
    assert len(json.loads(live.read_bytes())["findings"]) > 3
