"""Truth that is made: from GNSS altitude or from a survey."""
