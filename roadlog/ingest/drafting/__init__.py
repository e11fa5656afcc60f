"""`profile new`: a profile drafted from a source's names, units and data."""
