"""Frames to transfers to messages: the engine around the native core, and what it makes of payloads."""
