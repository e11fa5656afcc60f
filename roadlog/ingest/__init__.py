"""Source files of any format become one MCAP log."""
