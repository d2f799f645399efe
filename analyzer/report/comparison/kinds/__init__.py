"""The kinds of differences: a module each, with `differences(pair)`."""
