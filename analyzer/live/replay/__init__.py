"""Frames sent to buses at their times, and what must not reach a real one."""
