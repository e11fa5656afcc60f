"""Numerics that the estimators share: kernels, Kalman filters and smoothers, strapdown, windows."""
