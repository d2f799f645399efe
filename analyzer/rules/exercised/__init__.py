"""The exercise that a capture gives: what rules need to be heard, and how much of it there was."""
