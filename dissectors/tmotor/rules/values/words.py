"""TYP-105: RawCommand with 16 bits for each throttle where 14 belong, the mistake that 4.4.1 explanation 4 warns of.

Two forms are known: one value as low byte, high byte and five zeros in a single frame; and an array of little-endian
words. The second has twice as many bytes as channels. What shows it is in the stream: such lengths do not exist with 14
bits, or the padding bits behind the last channel are set, or values are negative where the words are not.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import Rule, breach, groups, rule, sender, usable
from dissectors.records import dataclass, field
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, Values, View

_MOST_BYTES = 16  # eight words (4.4.1 expl. 3): sparse commands of more channels can look like words
_BITS, _BYTE = 14, 8
_PERIOD, _CHANNELS = 14, 8  # so many bytes are seven words or eight throttles: no padding tells them apart
_MOST_SENDERS = 1024
_RECENT = 64  # commands that are compared
_ALIKE = 1.25  # random words are about as wild in either form
_WIDER, _NOISE = 5, 64  # a single word covers four times as much as what is made of it
_SHOWN = 8  # values
# Channels of the first eight, and the lowest of three bits in them that are the signs of words.
_SIGNS = ((0, 11), (1, 9), (4, 5), (5, 3), (6, 1))
_NOTHING, _IF_NEW, _SURE = range(3)


@rule("TYP-105")
def one_word(view: View) -> Iterator[Occurrences]:
    """Find one value as low byte, high byte and five zeros, where four channels of 14 bits belong (4.4.1, example).

    The low two bits of the high byte come out as 64 times as much in the second channel; where that stands alone, only
    one motor may be tried.
    """
    table = view.table("RawCommand")
    if table is None:
        return
    starts, values = table.lists("cmd")
    rows = (np.diff(starts) == 4).nonzero()[0]
    at = starts[rows]
    rows = rows[(values[at + 3] == 0) & (values[at + 2] == 0) & np.isin(values[at + 1], (64, 128, 192))]
    if not rows.size:
        return
    first = values[starts[rows]]
    exact = (first > 0) & (first < 1 << 12) & (table["layout"][rows] == 0) & (table["bits_left"][rows] == 0)
    single = ~view.transfers.has("crc_wire")[table.row[rows]]
    rows = rows[exact & single & table.trusted[rows]]

    def values_of(row: int) -> Values:
        one, two = (int(value) for value in values[starts[row] : starts[row] + 2])
        word = one & 0xFF | (one >> 8 << 2 | two >> 6) << 8
        return {"words": f"a word {word}", "sent": f"{one}, {two}, 0, 0"}

    yield view.among_rows("TYP-105", table, rows, values_of)


class Words(Rule):
    """Arrays of words; `min_transfers` of a sender that say so, with none between them that cannot be one."""

    rules = ("TYP-105",)

    def __init__(self) -> None:
        """Begin without a command."""
        self._streams: dict[tuple[int, int], _Stream] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Follow the senders whose commands may be such arrays."""
        table = view.table("RawCommand")
        if table is None:
            return
        length = view.transfers.length[table.row]
        even = (length > 0) & (length <= _MOST_BYTES) & (length % 2 == 0)
        rows = (even & usable(table) & ~view.transfers.fd[table.row]).nonzero()[0]
        for key, places in groups(sender(table, rows).astype(np.int64) << 8 | length[rows]):
            mine, who = rows[places], (key >> 8, key & 0xFF)
            if who in self._streams or (_may_be_words(table, mine) and len(self._streams) < _MOST_SENDERS):
                stream = self._streams.setdefault(who, _Stream())
                yield from stream.follow(view, table, mine)
                if not stream.under_way:
                    del self._streams[who]


def _may_be_words(table: DecodedTable, rows: Array) -> bool:
    """Return whether some commands of one length may be arrays of words; cheap, as nearly all are none.

    Without padding all bits that would be signs of words must be equal.
    """
    if (table["bits_left"][rows] >= _BYTE).any() or table["pad_nonzero"][rows].any():
        return True
    starts, values = table.lists("cmd")
    at, channels = starts[rows], int(starts[rows[0] + 1] - starts[rows[0]])
    if channels < _CHANNELS:
        return False
    mask = np.ones(len(rows), bool)
    for channel, low in _SIGNS:
        bits = values[at + channel] >> low & 7
        mask &= (bits == 0) | (bits == 7)
    return any(values[at[k] : at[k] + channels].any() for k in mask.nonzero()[0].tolist())


@dataclass(slots=True)
class _Stream:
    """The commands of one sender and length since the last one that is no array of words.

    `recent` are the last ones that are not all zero, as words and as sent, with the padding; `held` are those that tell
    something until they are enough.
    """

    recent: deque[tuple[Array, Array, int]] = field(default_factory=lambda: deque(maxlen=_RECENT))
    seen: set[bytes] = field(default_factory=set)
    held: list[Occurrence] = field(default_factory=list)
    sure: bool = False

    @property
    def under_way(self) -> bool:
        """Something was told."""
        return self.sure or bool(self.held)

    def follow(self, view: View, table: DecodedTable, rows: Array) -> Iterator[Occurrence]:
        """Add commands of a batch, all of one length."""
        starts, values = table.lists("cmd")
        channels = int(starts[rows[0] + 1] - starts[rows[0]])
        payloads = view.transfers.payloads(table.row[rows])
        words = payloads.view("<i2")
        fits: Array = np.all((words <= FULL_THROTTLE) & (words >= -FULL_THROTTLE), axis=1)
        begun = np.cumsum(~fits)[fits]  # how often it had to begin anew by then
        rows, payloads, words = rows[fits], payloads[fits], words[fits].astype(np.int32)
        sent = values[starts[rows][:, None] + np.arange(channels)].astype(np.int32)
        told = _telling(table, rows, words, sent, payloads[:, -1])
        spare = payloads[:, -1].astype(np.int64) & (1 << 8 * payloads.shape[1] - _BITS * channels & 0xFF) - 1
        past = 0
        for k in self._to_follow(begun, told, np.any(payloads, axis=1)).tolist():
            if begun[k] != past:
                self._begin()
                past = int(begun[k])
            payload = payloads[k].tobytes()
            fresh = payload not in self.seen
            self.recent.append((words[k].copy(), sent[k].copy(), int(spare[k])))
            if len(self.seen) < _RECENT:
                self.seen.add(payload)
            if told[k] == _SURE or (told[k] == _IF_NEW and (fresh or self.sure)):
                yield from self._tell(view, table, int(rows[k]), (words[k], sent[k]))
        if past != len(fits) - len(rows):
            self._begin()

    def _begin(self) -> None:
        """Forget everything."""
        self.recent.clear()
        self.seen.clear()
        self.held, self.sure = [], False

    def _to_follow(self, begun: Array, told: Array, any_: Array) -> Array:
        """Return the places of commands that are not all zero, from the first one on that tells something."""
        telling = np.cumsum((told != _NOTHING) & any_)
        first = begun.searchsorted(begun)  # the first place since it began
        before = np.append(0, telling)[first]
        follow: Array = (any_ & ((telling > before) | ((begun == 0) & self.under_way))).nonzero()[0]
        return follow

    def _tell(self, view: View, table: DecodedTable, row: int, both: tuple[Array, Array]) -> Iterator[Occurrence]:
        names = "a word" if len(both[0]) == 1 else "words"
        values = {"words": f"{names} {_listed(both[0])}", "sent": _listed(both[1])}
        found = breach(view, table, row, "TYP-105", values, held=not self.sure)
        if self.sure:
            yield found
            return
        self.held = [*self.held[-_RECENT:], found]
        enough = int(view.number("TYP-105", "min_transfers"))
        if len(self.held) >= enough and len(self.held) % enough == 0 and self._believable():
            self.sure = True
            yield from self.held
            self.held = []

    def _believable(self) -> bool:
        """Return whether the values are no wilder as words; with a length that 14 bits have not they may be."""
        words, sent = (np.array(column) for column in list(zip(*self.recent, strict=True))[:2])
        spare = 2 * _BYTE * words.shape[1] - _BITS * sent.shape[1]
        if spare >= _BYTE:
            return True
        if words.shape[1] >= _PERIOD // 2:
            return _steps(words) <= _ALIKE * _steps(sent)
        padding = {one for *_, one in self.recent}
        if len(padding) == 1 and np.ptp(words[:, -1]):
            return False  # bits of a throttle that moves do not stand still
        return _steps(words) <= _WIDER * _steps(sent) + _NOISE


def _steps(values: Array) -> float:
    """Return how far all values together go from one command to the next."""
    return float(np.abs(np.diff(values, axis=0)).sum()) / len(values)


def _telling(table: DecodedTable, rows: Array, words: Array, sent: Array, last: Array) -> Array:
    """Return what each command tells if its words are throttles: nothing, or _SURE, or _IF_NEW if it is another one.

    `last` are their last bytes.
    """
    over = table["bits_left"][rows] >= _BYTE
    surely = (over & (last != 0)) | (~over & table["pad_nonzero"][rows])
    more, less = np.count_nonzero(sent, axis=1), np.count_nonzero(words, axis=1)
    plain = ~over & (words.shape[1] * 2 >= _PERIOD)  # padding says nothing
    surely |= plain & (words > 0).all(axis=1) & (sent < 0).any(axis=1)
    surely |= plain & (np.ptp(words, axis=1) == 0) & (np.ptp(sent, axis=1) > 0)
    dense = 2 * less >= words.shape[1]  # of two motors alone, values with few bits can look like words
    return np.where(surely, _SURE, np.where((over | (plain & dense)) & (more > less), _IF_NEW, _NOTHING))


def _listed(values: Array) -> str:
    shown = ", ".join(map(str, values[:_SHOWN].tolist()))
    return shown if len(values) <= _SHOWN else f"{shown} ..."
