"""Folders of drives: a table and a page."""
