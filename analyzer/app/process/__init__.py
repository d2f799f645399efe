"""The process that a command runs in: how it starts and is interrupted, its streams and threads."""
