"""Batch over logs: rows, tables, pages. `run` is the whole of it."""
