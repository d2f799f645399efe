"""What broke first: causes that can be told, what speaks for and against each, and what cannot be known."""
