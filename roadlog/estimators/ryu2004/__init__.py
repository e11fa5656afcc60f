"""Ryu 2004: road bank and vehicle roll from GNSS and inertial sensors."""
