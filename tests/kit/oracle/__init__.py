"""The search for causes of broken transfers, frame by frame in Python: what the core's is compared with."""
