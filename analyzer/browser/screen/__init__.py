"""The browser on a terminal, with Textual: widgets that draw lines, the keys, and what they do."""
