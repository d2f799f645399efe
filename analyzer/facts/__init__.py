"""The contents of a capture, as plain data: counters over batches, names and meanings of columns, dialects of nodes."""
