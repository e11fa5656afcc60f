"""Evidence in a drive of how the car moved and how its IMU lies."""
