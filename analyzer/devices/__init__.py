"""Which device a row of a table speaks of, its columns as numbers, and how a node reads doubtful ones."""
