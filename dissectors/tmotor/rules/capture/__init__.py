"""Rules that say what a recording of motors lacks."""
