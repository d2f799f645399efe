"""What a capture holds, as plain data: counters over batches, names and meanings of columns, dialects of nodes."""
