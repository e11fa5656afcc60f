"""Luo 2024: tire-force based grade and bank, and its baselines."""
