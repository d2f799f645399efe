"""The format of a capture: told by its first bytes, then from its name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import PurePath

UTF8_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class Format:
    """A capture format. `module` has its `read(source, chunks)`; None is for what cannot be read.

    `unit` is what its rows are counted in. Of text, `line` is what most lines of it look like.
    """

    name: str
    module: str | None
    magics: tuple[bytes, ...]
    suffixes: tuple[str, ...] = ()
    unit: str = "record"
    line: re.Pattern[bytes] | None = None


CANDUMP = Format(
    "candump text",
    "candump",
    (b"(", b"Normal ("),
    unit="line",
    line=re.compile(
        rb"^[^\S\n]*\(\S+[^\S\n]|[0-9A-Fa-f]#|DROPCOUNT|ERRORFRAME|^[^\S\n]*\S+[^\S\n]+[0-9A-Fa-f]{3,8}[^\S\n]+\[\d",
        re.MULTILINE,
    ),
)
FORMATS = (
    Format("MCAP", "mcap", (b"\x89MCAP0\r\n",), (".mcap",)),
    Format("pcapng", "native", (b"\n\r\r\n",), (".pcapng",)),
    Format(
        "pcap",
        "native",
        tuple(bytes.fromhex(word) for word in ("d4c3b2a1", "a1b2c3d4", "4d3cb2a1", "a1b23c4d")),
        (".pcap",),
    ),
    Format("ArduPilot dataflash", "native", (b"\xa3\x95",)),
    Format("pydronecan log", "native", (b"\x34\x29",)),
    Format("Vector BLF", "python_can", (b"LOGG",), (".blf",)),
    Format("MDF 4", "python_can", (b"MDF     ", b"UnFinMF "), (".mf4",)),
    Format(
        "Vector ASC",
        "python_can",
        (b"date ", b"base hex", b"base dec", b"//"),
        (".asc",),
        "line",
        re.compile(rb"^[^\S\n]*\d+\.\d+[^\S\n]+(\d|CAN|Start)", re.MULTILINE),
    ),
    Format(
        "PEAK TRC",
        "python_can",
        (b";$FILEVE", b";#######"),
        (".trc",),
        "line",
        re.compile(rb"^;|^[^\S\n]*\d+\)?[^\S\n]+\d", re.MULTILINE),
    ),
    Format(
        "python-can CSV", "python_can", (b"timestam",), (".csv",), "line", re.compile(rb"^\d+\.?\d*,|,0x", re.MULTILINE)
    ),
    Format("xz", None, (b"\xfd7zXZ\0",)),
    Format("bzip2", None, (b"BZh",)),
    Format("zip", None, (b"PK\x03\x04",)),
    Format("UTF-16 text", None, (b"\xff\xfe", b"\xfe\xff")),
    Format("a Git LFS pointer (git lfs pull gets the file)", None, (b"version ",)),
    Format("a program", None, (b"\x7fELF", b"MZ\x90\0", b"#!/")),
    CANDUMP,
)
_TEXT = Format("a text file", None, ())
# As many bytes decide.
LONGEST = max(len(magic) for form in FORMATS for magic in form.magics)
_COMMENT = b"#"  # of candump text: prose has them, too
# So many lines tell text of another kind, and so few in a hundred do not make it one of ours.
_TELLING_LINES, _FEW = 3, 5
# Of a magic that is cut off, as many bytes tell.
_TELLING = 3
# No text has these bytes.
_CONTROL = frozenset(range(32)) - {*b"\t\n\r\f\x1b"} | {0x7F, *range(0x80, 0x100)}
_PACKED = (".gz", ".zst", ".zstd")


def detect(head: bytes, name: str, *, stored: bool = False) -> Format:
    """Return the format of a capture that starts with `head`; text that nothing claims is candump's.

    A capture that is over before its magic is whole still shows what it was to become. Of a `stored` one the lines are
    looked at, too, as many as are there: in front of what comes through a pipe there may be other text.
    """
    for form in FORMATS:
        cut = len(head) >= _TELLING and any(magic.startswith(head) for magic in form.magics)
        if cut or head.startswith(form.magics):
            return form
    path = PurePath(name.lower())
    suffix = PurePath(path.stem).suffix if path.suffix in _PACKED else path.suffix
    named = next((form for form in FORMATS if suffix in form.suffixes), CANDUMP)
    if named.unit == "record":
        return _TEXT if len(head) >= _TELLING and not _CONTROL.intersection(head) else named
    return _TEXT if stored and _is_other_text(head, named) else named


def _is_other_text(head: bytes, form: Format) -> bool:
    """Return True if there are lines, all of them whole, and next to none is like those of this format."""
    if form.line is None or b"\0" in head:
        return False
    whole = head[: head.rfind(b"\n") + 1]
    lines = sum(bool(line.strip()) and not line.startswith(_COMMENT) for line in whole.split(b"\n"))
    return lines >= _TELLING_LINES and 100 * sum(1 for _ in form.line.finditer(whole)) < _FEW * lines
