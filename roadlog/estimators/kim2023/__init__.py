"""Kim 2023: road slope and body pitch at stops, by reverse-time integration."""
