"""Message tables are made when somebody looks at them, and are then the same whenever that is."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.judged import registry
from kit.traffic import UNIT, log

from analyzer.decode import messages
from analyzer.decode.engine import Engine

if TYPE_CHECKING:
    from collections.abc import Iterator

STEP = 30_000


def batches(path: str, *, ahead: bool) -> Iterator[Any]:
    engine = Engine(ahead=ahead)
    text = Path(path).read_bytes()
    for at in range(0, len(text), STEP):
        yield from engine.feed(text[at : at + STEP])
        yield from engine.flushed()
    yield from engine.end()


@pytest.mark.parametrize("ahead", [True, False])
@pytest.mark.parametrize("path", ["captures/dialects.txt", "captures/mission-8-faults.log"])
def test_a_table_is_the_same_at_once_and_at_the_end(path: str, ahead: bool) -> None:
    at_once = [dict(batch.messages) for batch in batches(path, ahead=ahead)]
    late = list(batches(path, ahead=ahead))
    assert len(at_once) == len(late) > 1
    for batch, tables in zip(reversed(late), reversed(at_once), strict=True):
        assert list(batch.messages) == list(tables)
        assert all(batch.messages[name].equals(tables[name], check_metadata=True) for name in reversed(tables))


def test_a_table_is_made_once_and_only_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    decode = messages.Messages._decode

    def counted(self: Any, message: Any, group: Any, first: int) -> Any:
        made.append(message.table)
        return decode(self, message, group, first)

    monkeypatch.setattr(messages.Messages, "_decode", counted)
    commanded = [batch for batch in batches("captures/hover-4.log", ahead=True) if "RawCommand" in batch.messages]
    assert commanded
    assert "RawCommand" not in made
    for batch in commanded:
        table = batch.messages["RawCommand"]
        assert batch.messages.get("RawCommand") is table
        assert dict(batch.messages.items())["RawCommand"] is table
        assert len(table)
    assert made.count("RawCommand") == len(commanded)
    with pytest.raises(KeyError):
        commanded[0].messages["NoSuchTable"]


def test_tables_of_several_batches_are_made_in_several_threads_at_once() -> None:
    """As rules and whoever shows what they judge do."""
    sent = []
    for number in range(32):
        packet = encode.packet("PUSHSCI.FocQuery", number, UNIT)
        fields = {"data_sequence": number, "data": list(packet)}
        sent.append((float(number), encode.transfer("PUSHSCI", fields, 10, number)))
    engine, text = Engine(registry()), (log(*sent) * 40).encode()
    found = [batch for _ in range(60) for batch in (*engine.feed(text), *engine.flushed())]
    tables = [batch.messages for batch in found if "PUSHSCI.FocQuery" in batch.messages]
    assert len(tables) > 50
    with ThreadPoolExecutor(4) as pool:
        rows = sum(pool.map(lambda some: len(some["PUSHSCI.FocQuery"]), tables))
    assert rows == 60 * 40 * 32
