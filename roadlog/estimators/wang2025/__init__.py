"""Wang 2025: inclination with a suspension model, and the fuel level."""
