"""A vehicle file: what a vehicle should be, in the words of its dissectors."""
