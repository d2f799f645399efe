"""The interfaces that there are, as a table of at most 80 columns where names allow it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.views.terminal import PLAIN, display_width, escape, fit

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.live.interfaces.links import Controller, Link, Timing, Traffic
    from analyzer.live.interfaces.listing import ListedInterface
    from analyzer.views.terminal import Palette

_HEAD = ("Interface", "Kind", "State", "Bit rate", "Data rate", "Restart", "Frames")
_UNITS = ((1_000_000, "M"), (1_000, "k"))
_BAD = ("bus off", "error passive", "error warning")
_NONE = "-"


def render(found: Sequence[ListedInterface], width: int = 80, palette: Palette = PLAIN) -> str:
    """Write a line for each interface, and below it what else the kernel knows; the others by name."""
    lines = list(_table([listed.link for listed in found if listed.link is not None], width, palette))
    if others := [escape(listed.name) for listed in found if listed.link is None]:
        lines += ["Found by python-can:", *(f"  {fit(name, width - 2)}" for name in others)]
    return "".join(f"{line}\n" for line in lines or ["no CAN interfaces"])


def _table(links: Sequence[Link], width: int, palette: Palette) -> Iterator[str]:
    rows = [_row(link) for link in links]
    widths = [max(map(display_width, column)) for column in zip(_HEAD, *rows, strict=True)]

    def line(cells: Sequence[str]) -> str:
        padded = (cell + " " * (size - display_width(cell)) for cell, size in zip(cells, widths, strict=True))
        return fit("  ".join(padded).rstrip(), width)

    if rows:
        yield palette.paint("head", line(_HEAD))
    for link, row in zip(links, rows, strict=True):
        style = _style(link)
        yield palette.paint(style, line(row)) if style else line(row)
        for text in _more(link):
            yield palette.paint("dim", fit(f"{'':{widths[0]}}  {text}", width))


def _row(link: Link) -> tuple[str, ...]:
    controller = link.controller
    return (
        escape(link.name),
        escape(link.kind) or _NONE,
        _state(link),
        _rate(controller.timing if controller else None),
        _rate(controller.data_timing if controller else None),
        _restart(controller),
        "FD" if link.fd else "classic",
    )


def _state(link: Link) -> str:
    if not link.up:
        return "down"
    return link.controller.state if link.controller is not None and link.controller.state else "up"


def _style(link: Link) -> str:
    state = _state(link)
    return "bad" if state in _BAD else "dim" if state == "down" else ""


def _rate(timing: Timing | None) -> str:
    """Write `500k 87.5%`: the bit rate and the sample point."""
    if timing is None:
        return _NONE
    rate = timing.bit_rate
    text = next((f"{rate / size:.7g}{unit}" for size, unit in _UNITS if rate >= size), str(rate))
    return f"{text} {timing.sample_point / 10:.1f}%" if timing.sample_point else text


def _restart(controller: Controller | None) -> str:
    if controller is None:
        return _NONE
    return f"{controller.restart_ms} ms" if controller.restart_ms else "never"


def _more(link: Link) -> Iterator[str]:
    controller = link.controller
    if controller is not None:
        modes = [mode for mode in controller.modes if mode != "fd"]
        if modes:
            yield f"modes: {', '.join(modes)}"
        if controller.tx_errors is not None:
            yield f"error counters: transmit {controller.tx_errors}, receive {controller.rx_errors}"
        counts = {"bus errors": controller.bus_errors, "bus off": controller.bus_offs, "restarts": controller.restarts}
        if any(counts.values()):
            yield "; ".join(f"{name}: {count:,}" for name, count in counts.items())
    if link.traffic is not None:
        yield f"{_frames(link.traffic)}; transmit queue {link.queue}"


def _frames(traffic: Traffic) -> str:
    dropped = traffic.receive_dropped + traffic.send_dropped
    return f"{traffic.received:,} frames received, {traffic.sent:,} sent, {dropped:,} dropped"
