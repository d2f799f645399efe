"""Functions from tables to text. A view judges nothing and reads no capture: it is given batches and writes lines.

Reading order: `sheets` (batches for the native renderer), `listing` with `phrases` and `values` (templates of lines),
`tree` with `contents` and `branches`, `hexdump` (for people), `records` and `fields` (for programs; `formats` lists
them), `rows` (transfers with their messages), `info` (the whole capture). `page` renders the manual.
"""
