"""The keys of the browser: what each does, for its bindings and for its help."""

from __future__ import annotations

from typing import NamedTuple

from analyzer.browser.supply import TABS


class KeyWords(NamedTuple):
    """Keys as Textual calls them, the action, the key as people call it, and what it does."""

    keys: str
    action: str
    called: str
    words: str


KEYS: dict[str, tuple[KeyWords, ...]] = {
    "Move": (
        KeyWords("up,k", "move(-1)", "up down", "the row, line or byte before, behind (also k j)"),
        KeyWords("down,j", "move(1)", "", ""),
        KeyWords("left,h,backspace", "sideways(-1)", "left right", "fold and open details; the byte before, behind"),
        KeyWords("right,l", "sideways(1)", "", ""),
        KeyWords("pageup", "page(-1)", "pgup pgdn", "a page; home end: the first, the last (end follows what comes)"),
        KeyWords("pagedown", "page(1)", "", ""),
        KeyWords("home,ctrl+home", "edge(-1)", "", ""),
        KeyWords("end,G,ctrl+end", "edge(1)", "", ""),
        KeyWords("tab", "pane(1)", "tab", "the next pane: list, details, bytes; it gets the room"),
        KeyWords("shift+tab", "pane(-1)", "", ""),
        KeyWords("ctrl+up,f7", "packet(-1)", "F7 F8", "the row before, behind, whatever pane is in use"),
        KeyWords("ctrl+down,f8", "packet(1)", "", ""),
        KeyWords("g,ctrl+g", "ask_go", "g ctrl+g", "go to a frame, or a time: 4711, 12.5, 12:49:54.89, 50%"),
        KeyWords("b,alt+left", "history(-1)", "b B", "back to where you were before a jump, and forward (alt+arrows)"),
        KeyWords("B,alt+right", "history(1)", "", ""),
        KeyWords("ctrl+left", "strip(-1)", "ctrl+arrow", "a column of the strip to the left, right; or click there"),
        KeyWords("ctrl+right", "strip(1)", "", ""),
        KeyWords("minus", "frame(-1)", "- +", "the frame of this transfer before, behind"),
        KeyWords("plus", "frame(1)", "", ""),
        KeyWords("comma", "sender(-1)", ", .", "the transfer before, behind of the same sender and type"),
        KeyWords("full_stop,.", "sender(1)", "", ""),
        KeyWords("less_than_sign", "type(-1)", "< >", "the transfer before, behind of the same type, of any sender"),
        KeyWords("greater_than_sign", "type(1)", "", ""),
        KeyWords("r", "counterpart", "r", "from a request to its response, and back"),
        KeyWords("right_square_bracket,]", "finding(1)", "[ ]", "the finding before, behind"),
        KeyWords("left_square_bracket,[", "finding(-1)", "", ""),
        KeyWords("right_curly_bracket", "event(1)", "{ }", "the event before, behind, the begin or end of a flight"),
        KeyWords("left_curly_bracket", "event(-1)", "", ""),
        KeyWords("right_parenthesis,)", "marked(1)", "( )", "the mark before, behind"),
        KeyWords("left_parenthesis,(", "marked(-1)", "", ""),
    ),
    "Find and filter": (
        KeyWords("slash,ctrl+f", "ask_find", "/", "find text, bytes (0a ff), or = and a filter"),
        KeyWords("n,ctrl+n", "next(1)", "n N", "the next match, the one before"),
        KeyWords("N,ctrl+b", "next(-1)", "", ""),
        KeyWords("equals_sign,=,ctrl+underscore", "ask_filter", "=", "the filter; tab completes, up: older ones"),
        KeyWords("escape", "clear", "esc", "end a search, leave a pane; then take the order, the filter off"),
        KeyWords("a", "apply('')", "a", "apply the selected field, or line of a tab, as filter"),
        KeyWords("p", "prepare('')", "p", "prepare it: it stands in the filter line"),
        KeyWords("ampersand,&", "apply('and')", "& | !", "and it, or it, and not it"),
        KeyWords("vertical_line,|", "apply('or')", "", ""),
        KeyWords("exclamation_mark,!", "apply('and not')", "", ""),
        KeyWords("A", "combine('apply')", "A P", "apply, prepare it in one of six ways; they are asked for"),
        KeyWords("P", "combine('prepare')", "", ""),
        KeyWords("f", "follow", "f", "follow: n node, t type, e ESC, u power unit, x service exchange"),
        KeyWords("i", "column(1)", "i I", "apply as column; take the last one off"),
        KeyWords("I", "column(-1)", "", ""),
        KeyWords("space,f10", "menu", "space F10", "a menu of what can be done here; or the right button of the mouse"),
        KeyWords("S", "sort", "S", "sort by the selected field, again: highest first, as recorded; or click a column"),
        KeyWords("c", "conversation", "c", "colour this conversation, up to six; a digit in front says which"),
    ),
    "Show": (
        KeyWords("number_sign", "numbers", "#", "names or numbers: types by ID, fields without words and units"),
        KeyWords("t,ctrl+t", "reference", "t ctrl+t", "count times from this row; again: from the first frame"),
        KeyWords("T", "times", "T", "times as -t: r relative, a time of day, ad, d, dd, e epoch, u, ud"),
        KeyWords("enter", "choose", "enter", "to the details; fold one, see a long one in full; go where a tab leads"),
        KeyWords("E", "explain", "E", "the page of the rule that names this row, or of this finding"),
        KeyWords("x", "fold_all", "x", "fold all details, open them again"),
        *(
            KeyWords(str(k), f"tab('{name}')", f"{k}" if k > 1 else "1", name if k > 1 else "packets: the three panes")
            for k, name in enumerate(TABS, 1)
        ),
        KeyWords("s,z", "ask_statistic", "s", "a statistic, as -z takes it: talkers, load, io,100ms"),
        KeyWords("question_mark,f1", "help", "?", "this page"),
        KeyWords("ctrl+l", "redraw", "ctrl+l", "draw everything anew"),
    ),
    "Keep and hand on": (
        KeyWords("v", "select(0)", "v", "select rows from here on, for y and w (shift and arrows or click)"),
        KeyWords("shift+up", "select(-1)", "", ""),
        KeyWords("shift+down", "select(1)", "", ""),
        KeyWords("ctrl+a", "select_all", "ctrl+a", "select all rows that are displayed"),
        KeyWords("m", "mark", "m", "mark this row, or all selected ones; take the mark off"),
        KeyWords("M", "ask_comment", "M", "a comment on it"),
        KeyWords("w,ctrl+s", "ask_write", "w ctrl+s", "write what is selected, or all that is displayed"),
        KeyWords("y", "copy", "y", "copy rows: t text, j JSON, c candump, d details, b bytes; v value, f filter"),
        KeyWords("o", "plot", "o", "open Rerun at this time (plot --around)"),
        KeyWords("ctrl+r", "reload", "ctrl+r", "read the capture anew, after it has grown or changed"),
        KeyWords("ctrl+z", "suspend", "ctrl+z", "back to the shell for a while; fg leads back"),
        KeyWords("q,ctrl+q", "leave", "q", "quit; asks once if marks are not kept yet"),
    ),
}  # fmt: skip
EVERY = tuple(key for keys in KEYS.values() for key in keys)
# The last line: what is told there, and what a click on it does.
HINTS = (
    ("? help", "help"), ("space menu", "menu"), ("= filter", "ask_filter"), ("/ find", "ask_find"),
    ("tab pane", "pane(1)"), ("] finding", "finding(1)"), ("1-7 tabs", "next_tab"), ("q quit", "leave"),
)  # fmt: skip
TAB_HINTS = tuple((f"{k} {name}", f"tab('{name}')") for k, name in enumerate(TABS, 1))


def hints(tab: str) -> tuple[tuple[str, str], ...]:
    """Return what the last line tells: keys for the panes, and in the other tabs which ones there are."""
    return HINTS if tab == TABS[0] else TAB_HINTS


def help_lines() -> list[tuple[str, str]]:
    """Return keys and what they do; headings have no key."""
    found: list[tuple[str, str]] = []
    for title, keys in KEYS.items():
        found += [("", title), *((one.called, one.words) for one in keys if one.words)]
    return found
