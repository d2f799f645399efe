"""The meaning of the bytes, written down as data.

A dissector is a folder: DSDL files give the layout on the wire, `profile.toml` gives what DSDL cannot say (units,
enumerations, bit parts, packets inside packets, limits, clauses). `load` finds the built-in folders, those of other
packages and those that a user names; adding a vendor is adding a folder. Nothing in here imports `analyzer`.
"""

from __future__ import annotations

from dissectors.dsdl import DsdlError
from dissectors.profile import Profile, ProfileError
from dissectors.registry import Registry, UnknownNameError, load

__all__ = ["DsdlError", "Profile", "ProfileError", "Registry", "UnknownNameError", "load"]
