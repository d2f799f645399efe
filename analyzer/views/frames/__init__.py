"""Frames as rows: of a list of frames, and those that form no transfer in a list of transfers."""
