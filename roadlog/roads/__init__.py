"""Road models out of drives, and back: merge, write and read, drive on them, take them as truth."""
