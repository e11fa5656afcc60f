"""Truth: a road, a car and its sensors that know nothing of any estimator."""
