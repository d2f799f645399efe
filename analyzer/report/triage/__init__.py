"""Triage for people and for programs: the screen, Markdown, JSON, a page."""
