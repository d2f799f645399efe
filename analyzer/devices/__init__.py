"""The device that a row of a table speaks of, its columns as numbers, and the reading of doubtful ones."""
