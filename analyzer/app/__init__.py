"""The application: one place where captures are opened, decoded, judged and cut, for every command and for Python."""
