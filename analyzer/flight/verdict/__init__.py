"""The first thing that broke: causes that can be told, what speaks for and against each, and what cannot be known."""
