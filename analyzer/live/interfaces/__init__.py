"""Interfaces of the bus: named, listed, opened, filtered, and received from as one stream."""
