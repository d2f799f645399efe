"""A live session: received, recorded, judged as it comes, shown."""
