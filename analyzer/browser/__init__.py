"""The browser: a list of packets of any length on a terminal, their details and bytes; nothing here opens a capture."""
