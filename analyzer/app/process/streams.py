"""The three standard streams, whatever the shell made of them: closed, full, or not in UTF-8."""

from __future__ import annotations

import codecs
import os
import signal
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_PLAIN = {"…": "~", "±": "+-", "°": "deg", "µ": "u"}
_ERRORS = "tailbyte.plain"


def prepare() -> None:
    """Give every stream a descriptor, and standard output a way to write what its encoding lacks.

    A closed one gets the null device, so that no file opened later takes its number: reading and standard output fail
    there, since somebody should know, standard error is lost.
    """
    for number, mode in enumerate((os.O_WRONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, mode), number)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - it lives as long as the process
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115 - as above
    codecs.register_error(_ERRORS, _plain)
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors=_ERRORS)


def complain(text: str, who: str = "tailbyte") -> None:
    """Say one line on standard error, harmless to a terminal."""
    from analyzer.views.terminal import escape  # noqa: PLC0415 - `--help` does without

    tell(f"{who}: {escape(text)}\n")


def tell(text: str) -> None:
    """Write to standard error; whoever closed it does not want to hear of it."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except OSError:
        forget(2)


class _TakesNothingError(Exception):
    """A stream has taken nothing for too long."""


@contextmanager
def bounded(seconds: float, *, wanted: bool) -> Iterator[None]:
    """Give up what is still to be written after so many seconds: a terminal that is held (Ctrl-S) takes nothing.

    It makes no difference unless it is `wanted`, and where there are no alarms.
    """
    if not wanted or not hasattr(signal, "SIGALRM"):
        yield
        return

    def give_up(*_: object) -> None:
        raise _TakesNothingError

    usual = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    except _TakesNothingError:
        for number in (1, 2):
            forget(number)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, usual)


def forget(number: int) -> None:
    """Forget what a stream still holds and cannot write; without this the interpreter tries again at its exit."""
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, number)
    os.close(sink)


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Error handler: a plain stand-in of about the same width, else a backslash escape."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    texts = (
        _PLAIN.get(c) or c.encode("ascii", "backslashreplace").decode("ascii")
        for c in error.object[error.start : error.end]
    )
    return "".join(texts), error.end
