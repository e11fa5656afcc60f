"""`roadlog estimators`: what there is and what it needs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from roadlog.cli import console, options


def estimators(
    as_json: options.AsJson = False,
) -> None:
    """List the estimators: what each needs and gives, its paper.

    Example: roadlog estimators --json
    """
    from roadlog.estimators import ALIASES, all_estimators

    found = all_estimators()
    if as_json:
        console.print_json(
            [
                {
                    "name": e.name,
                    "aliases": [alias for alias, name in ALIASES.items() if name == e.name],
                    "summary": e.summary,
                    "needs": list(e.needs),
                    "gives": list(e.gives),
                    "reference": e.reference,
                    "causal": e.causal,
                    "vehicle": list(e.vehicle),
                    "parameters": {
                        f.name: {
                            "default": f.default,
                            "unit": f.metadata["unit"],
                            "doc": f.metadata["doc"],
                        }
                        for f in dataclasses.fields(e.parameters)
                    },
                }
                for e in found
            ]
        )
        return
    rows = [[e.name, ", ".join(e.gives), e.summary, _brief(e.needs), e.reference] for e in found]
    console.print_table(
        ["name", "gives", "what it does", "needs", "source"], rows, left=5, spare=["source"]
    )


def _brief(signals: Sequence[str]) -> str:
    """imu.accel_x, imu.accel_z as imu.accel_x/z."""
    axes: dict[str, list[str]] = {}
    for signal in signals:
        stem, _, axis = signal.rpartition("_")
        if axis in ("x", "y", "z"):
            axes.setdefault(stem, []).append(axis)
        else:
            axes[signal] = []
    return ", ".join(f"{stem}_{'/'.join(found)}" if found else stem for stem, found in axes.items())
