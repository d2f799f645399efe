"""Functions from tables to text. A view judges nothing and reads no capture: it is given batches and writes lines.

Reading order: `rows` (what a batch holds, transfer by transfer), `listing`, `tree` and `hexdump` (for people),
`records` and `fields` (for programs; `formats` lists them), `info` (the whole capture). `page` renders the manual.
"""
