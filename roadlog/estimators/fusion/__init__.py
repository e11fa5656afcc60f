"""`fusion`: a smoother over the whole drive with everything that the log has."""
