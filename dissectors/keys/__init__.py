"""Every key of a dissector's files: what it may hold and what it means.

The readers of these files take types, words and limits from here, so no other key is read, and `dissectors.reference`
writes the reference for people from the same.
"""

from __future__ import annotations

from dissectors.keys.key import Key, Keys
from dissectors.keys.pages import CLAUSES, PAGES, PRINTED
from dissectors.keys.plots import PLOTS
from dissectors.keys.profile import PACKET_FILE, PROFILE

__all__ = ["CLAUSES", "FILES", "PACKET_FILE", "PAGES", "PLOTS", "PRINTED", "PROFILE", "Key", "Keys"]

FILES = (PROFILE, PACKET_FILE, PAGES, PLOTS, CLAUSES, PRINTED)
