"""Colour rules: rows of lists in the colours that somebody wants, by filter. Imported only where lists have colours."""
