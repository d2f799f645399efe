"""Captures and buses for the browser: decoded into its store, then judged from there."""
