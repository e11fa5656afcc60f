"""`roadlog demo`: the whole way once, without any data of one's own."""

from __future__ import annotations

from roadlog.cli import console

SCENARIO = "wang2025-up9"
ESTIMATORS = ["fusion", "kmbe", "ekf_suspension", "lowpass_attitude"]  # one of each kind


def demo() -> None:
    """Simulate a drive, estimate, compare with the truth, record it.

    Everything goes into a new temporary folder; the last lines say what to try next.

    Example: roadlog demo
    """
    import tempfile
    from pathlib import Path

    from roadlog.cli.estimate import estimate
    from roadlog.cli.evaluate import evaluate
    from roadlog.cli.simulate import simulate
    from roadlog.cli.view import view

    folder = Path(tempfile.mkdtemp(prefix="roadlog-demo-"))
    log, recording = folder / "demo.mcap", folder / "demo.rrd"
    console.say(f"1. Simulate {SCENARIO}: 100 s over a 9 deg hill, with sensor noise and truth.")
    simulate(SCENARIO, out=log)
    console.say(
        "\n2. Estimate the angles from speed and accelerations; the truth is not looked at."
    )
    estimate([log], ESTIMATORS)
    console.say("\n3. Compare with the truth. Grade: the road, uphill +. Inclination: the body.")
    evaluate([log])
    console.say("\n4. Write a recording to look at.")
    view([log], save=recording)
    console.say("\nTry next:")
    for command in (f"roadlog info {log}", f"roadlog view {log}", "roadlog estimators"):
        console.say(f"  {command}")
