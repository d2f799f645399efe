"""Doors of other programs: tools of python-can, and the viewer of Rerun."""
