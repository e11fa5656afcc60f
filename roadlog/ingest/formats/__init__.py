"""One module a format of source files."""
