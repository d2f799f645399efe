"""Commands, reports and packets as several rules ask for them: joined, split by ESC, followed over batches."""
