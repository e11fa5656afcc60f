"""What is known of a car, and the corrections that follow from it; no estimator."""
