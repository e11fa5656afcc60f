"""Numerics that the estimators share: kernels, Kalman filters and smoothers, strapdown, windows."""

from __future__ import annotations

from typing import Literal, get_args

Engine = Literal["compiled", "reference"]  # numba, or filterpy and plain Python
ENGINES: tuple[str, ...] = get_args(Engine)
