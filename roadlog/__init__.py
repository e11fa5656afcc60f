"""Road grade and bank, vehicle pitch and roll, from the log of an ordinary drive."""
