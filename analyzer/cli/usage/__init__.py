"""The command line about itself: the first steps, help on a screen, examples, hints for what does not exist."""
