"""The papers' figures drawn anew with our data: `roadlog reproduce PAPER --figures DIR`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.signals import TRUTH_TOPIC, truth_topic
from roadlog.simulate import simulate
from roadlog.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (9.0, 5.0)  # inches
Plot = Callable[["Figure"], None]


@dataclass(frozen=True)
class Drawing:
    """One figure: file name, the paper's figure, what it shows, and how it is drawn."""

    name: str
    of: str
    caption: str
    draw: Plot


@dataclass(frozen=True)
class _Run:
    """A simulated drive, its truth on the drive's clock, and estimates of it."""

    drive: Drive
    truth: dict[str, Floats]
    estimates: dict[str, Estimate]
    details: dict[str, Floats]


def drawings(paper: str) -> list[Drawing]:
    """Of one paper; none for what is no paper."""
    return {
        "massel2004": _massel,
        "ryu2004": _ryu,
        "kim2023": _kim,
        "luo2024": _luo,
        "wang2025": _wang,
    }.get(paper, list)()


def _run(
    scenario: str,
    methods: Mapping[str, tuple[str, Mapping[str, Any]]],
    detail: str = "",
    **options: Any,
) -> _Run:
    simulation = simulate(scenario, seed=1, **options)
    drive = Drive.from_tables(simulation.tables)
    table = simulation.table(TRUTH_TOPIC)

    def true(columns: Mapping[str, Any], time: Any) -> dict[str, Floats]:
        return {
            name: np.interp(drive.time_ns, time, values)
            for name, values in columns.items()
            if name not in ("flags", "valid")
        }

    found = {
        label: estimators.run(name, drive, simulation.vehicle, settings)
        for label, (name, settings) in methods.items()
    }
    extra = simulation.table(truth_topic(detail)) if detail else None
    details = true(extra.columns, extra.time) if extra is not None else {}
    return _Run(drive, true(table.columns, table.time), found, details)


def _lines(axes: Axes, run: _Run, angle: str, labels: Iterable[str] = ()) -> None:
    """An angle over time, truth first; the scale is the truth's and half of it beside."""
    true = np.degrees(run.truth[angle])
    low, high = true.min(), true.max()
    margin = max(0.5 * (high - low), 1.0)
    axes.plot(run.drive.time, true, "k", linewidth=1.6, label="truth")
    for label in labels or run.estimates:
        values = np.degrees(run.estimates[label].angles[angle])
        axes.plot(run.drive.time, values, linewidth=0.9, label=label)
    axes.set_ylim(low - margin, high + margin)
    axes.set(xlabel="time [s]", ylabel=f"{angle} [deg]")
    axes.legend(fontsize="small", ncols=3)


def _massel() -> list[Drawing]:
    printed = {"preset": "paper"}
    names = ("ls_window", "rls_forget", "ti", "pn", "ti_rls")

    def figure(scenario: str) -> Plot:
        def draw(figure: Figure) -> None:
            run = _run(f"massel2004-{scenario}", {name: (name, printed) for name in names})
            above, below = figure.subplots(2, 1, sharex=True)
            _lines(above, run, "grade", names[:2])
            _lines(below, run, "grade", names[2:])

        return draw

    return [
        Drawing(
            "massel2004-quasi",
            "of Figs 4-7",
            "Grade in the quasi-steady drive, printed methods: identification above, analytic and "
            "combined below; what errs by more than 1 deg leaves the plot, the analytic methods "
            "where dv/dt is near 0. The paper's curves are of a CarSim car and carry no numbers: "
            "only the order of the methods can be compared.",
            figure("quasi"),
        ),
        Drawing(
            "massel2004-accel",
            "of Figs 4-7",
            "Grade through four gear shifts: identification leaves the plot, the analytic methods "
            "stay; the combination takes the recursion at each shift, where the paper's stays "
            "with ti. Times and depth of the shifts are ours.",
            figure("accel"),
        ),
    ]


def _ryu_model(figure: Figure) -> None:
    from roadlog.reproduce.ryu2004 import single_track

    simulation = simulate("ryu2004-slalom", seed=1)
    drive = Drive.from_tables(simulation.tables)
    ins = estimators.run("gnss_ins", drive, simulation.vehicle, {"smooth": False})
    beta = ins.details["sideslip"].columns["beta"]
    states = single_track(drive, simulation.vehicle)
    pairs = ((beta, "sideslip [deg]"), (drive["imu.gyro_z"], "yaw rate [deg/s]"))
    for k, (axes, (seen, label)) in enumerate(
        zip(figure.subplots(2, 1, sharex=True), pairs, strict=True)
    ):
        axes.plot(drive.time, np.degrees(seen), "k", linewidth=1.6, label="GNSS/INS")
        axes.plot(drive.time, np.degrees(states[:, k]), linewidth=0.9, label="vehicle model")
        axes.set(xlabel="time [s]", ylabel=label)
        axes.legend(fontsize="small")


def _ryu_by_place(figure: Figure) -> None:
    from roadlog.reproduce import bank_by_place

    axes = figure.subplots()
    at = (np.arange(bank_by_place.BINS) + 0.5) * 360.0 / bank_by_place.BINS
    for direction in bank_by_place.DIRECTIONS:
        for crawl, line in ((False, "-"), (True, "--")):
            found = bank_by_place.places(direction, crawl, 1)
            label = f"{'crawl' if crawl else 'laps'} to the {direction}"
            axes.plot(at, np.degrees(found.mean), line, linewidth=1.0, label=label)
    axes.set(xlabel="place on the circle [deg]", ylabel="bank of a left turn [deg]")
    axes.legend(fontsize="small")


def _ryu() -> list[Drawing]:
    methods = {"observer, causal": ("roll_bank_obs", {"smooth": False})}

    def figure(case: str) -> Plot:
        def draw(figure: Figure) -> None:
            run = _run(f"ryu2004-{case}", methods)
            every = figure.subplots(3, 1, sharex=True)
            for axes, angle in zip(every, ("bank", "roll", "roll_total"), strict=True):
                _lines(axes, run, angle)

        return draw

    return [
        Drawing(
            "ryu2004-model",
            "Fig 4",
            "Sideslip and yaw rate by GNSS/INS and by the single-track model on the steering "
            "alone, in a slalom. The paper's is of its own car.",
            _ryu_model,
        ),
        Drawing(
            "ryu2004-slalom",
            "slalom; number not verified",
            "Bank, roll and total roll in a slalom on a flat road: the roll follows the side "
            "force, the bank errs by up to 0.3 deg. The paper's bank stays within 1 deg.",
            figure("slalom"),
        ),
        Drawing(
            "ryu2004-laps",
            "Fig 5",
            "Bank, roll and total roll on laps of a tilted plane: the total roll is mostly "
            "positive, the bank as often up as down, and comes again every lap of about 20 s. The "
            "body on springs rolls faster than the observer's causal estimate follows. The paper "
            "drove a parking lot, its bank is another.",
            figure("laps"),
        ),
        Drawing(
            "ryu2004-places",
            "Fig 6",
            "Bank by place, by laps and by a static crawl over the same circle, in both "
            "directions. The paper's marks lie on its own lot, its bank is another.",
            _ryu_by_place,
        ),
    ]


def _kim_bias(figure: Figure) -> None:
    from roadlog.reproduce.kim2023.motions import BIASES, GRID, Cell

    groups = []
    for value in BIASES:
        cell = Cell(bias=float(value))
        run = _run("kim2023-mc", {"printed": ("static_slope", GRID)}, overrides=cell.overrides)
        columns = run.estimates["printed"].details["events"].columns
        used = columns["valid"]
        groups.append([np.degrees(columns[n][used]) for n in ("inclination", "pitch")])
    ticks = [f"{value:+.1f}" for value in BIASES]
    for k, (axes, name) in enumerate(
        zip(figure.subplots(2, 1, sharex=True), ("inclination", "pitch"), strict=True)
    ):
        axes.boxplot([group[k] for group in groups], tick_labels=ticks)
        axes.set(xlabel="accelerometer bias along x [m/s2]", ylabel=f"{name} [deg]")


def _kim_noise(figure: Figure) -> None:
    from roadlog.reproduce.kim2023.motions import GRID, MICRO_G, NOISES

    groups: dict[str, list[Floats]] = {"inclination": [], "slope": [], "pitch": []}
    for density in NOISES:
        overrides = {"accel_noise": density * MICRO_G, "speed.motions": 25}
        run = _run("kim2023-mc", {"printed": ("static_slope", GRID)}, overrides=overrides)
        columns = run.estimates["printed"].details["events"].columns
        inclination, pitch = (columns[n][columns["valid"]] for n in ("inclination", "pitch"))
        for group, angle in zip(
            groups.values(), (inclination, inclination - pitch, pitch), strict=True
        ):
            group.append(np.degrees(angle))
    ticks = [str(density) for density in NOISES]
    for axes, (name, group) in zip(figure.subplots(3, 1, sharex=True), groups.items(), strict=True):
        axes.boxplot(group, tick_labels=ticks)
        axes.set(xlabel="accelerometer noise [ug/rtHz]", ylabel=f"{name} [deg]")


def _kim() -> list[Drawing]:
    def urban(figure: Figure) -> None:
        methods: dict[str, tuple[str, Mapping[str, Any]]] = {
            "static_slope, printed": ("static_slope", {"align": "paper"}),
            "static_slope, mended": ("static_slope", {}),
            "kasaba": ("kasaba", {}),
            "grade_pitch_ekf": ("grade_pitch_ekf", {}),
        }
        run = _run("kim2023-urban", methods)
        axes = figure.subplots()
        for label, estimate in run.estimates.items():
            axes.plot(run.drive.time, np.degrees(estimate.pitch), label=label, linewidth=1.0)
        axes.axhline(0.3, color="k", linewidth=1.6, label="truth")
        axes.set(xlabel="time [s]", ylabel="pitch of the standing body [deg]", ylim=(-1.0, 1.6))
        axes.legend(fontsize="small")

    return [
        Drawing(
            "kim2023-bias",
            "Figs 13-15",
            "Inclination and pitch of the events at 2 m/s2 by the accelerometer's bias, as "
            "printed: the inclination takes it, the pitch does not. The noise is the same at each "
            "bias, so the boxes of the pitch are too. The paper crosses it with slope, pitch and "
            "acceleration, as the table does.",
            _kim_bias,
        ),
        Drawing(
            "kim2023-noise",
            "Fig 16",
            "50 events at 2 m/s2 on the level by the noise of the accelerometer, as printed: the "
            "inclination at rest stays within 0.1 deg, slope and pitch spread alike and up to "
            "about 1 deg as a range, as in the paper. Its grades of 5 and 10 % are in the table; "
            "they spread no more.",
            _kim_noise,
        ),
        Drawing(
            "kim2023-convergence",
            "Fig 26",
            "Running estimates over the urban drive, load 0.3 deg, IMU 1.9 m ahead. As printed the "
            "mean stays 0.4 deg off, because the body still rocks where it is aligned; the paper's "
            "ends within 0.1. Both baselines are our reconstructions; the paper's end further off.",
            urban,
        ),
    ]


def _luo() -> list[Drawing]:
    methods: dict[str, tuple[str, Mapping[str, Any]]] = {
        "KMBE, printed": ("kmbe", {"variant": "paper", "smooth": False}),
        "DEBE, printed": ("debe", {"variant": "eq37"}),
        "TFOBE, printed (text)": ("tfobe", {"variant": "text"}),
        "TFOBE, mended": ("tfobe", {}),
    }

    def grade(figure: Figure) -> None:
        _lines(figure.subplots(), _run("luo2024-s3", methods, ideal=True), "grade")

    def forces(figure: Figure) -> None:
        run = _run("luo2024-s3", {"mended": ("tfobe", {})}, "tire_forces", ideal=True)
        columns = run.estimates["mended"].details["tires"].columns
        above, below = figure.subplots(2, 1, sharex=True)
        for axes, name, true in (
            (above, "fx_rl", run.details["fx_rl"]),
            (below, "fy_front", run.details["fy_fl"] + run.details["fy_fr"]),
        ):
            axes.plot(run.drive.time, true, "k", label="truth")
            axes.plot(run.drive.time, columns[name], "C1", linewidth=0.9, label="TFOBE, mended")
            axes.set(ylabel=f"{name} [N]", xlabel="time [s]")
            axes.legend(fontsize="small")

    return [
        Drawing(
            "luo2024-grade",
            "grade on the curved road; number not verified",
            "Grade on the curved road (s3), exact signals. The paper's TFOBE follows the truth, "
            "as the mended one does here; as printed it is off by what its equations leave out. "
            "DEBE errs where the car brakes, because eq. 37 has no brake; KMBE is noisy but true, "
            "where the paper has it worst.",
            grade,
        ),
        Drawing(
            "luo2024-forces",
            "Fig 7",
            "Longitudinal force of the rear left wheel and lateral force of the front axle on s3. "
            "The paper draws single wheels, whose lateral force is not observable.",
            forces,
        ),
    ]


def _wang() -> list[Drawing]:
    methods: dict[str, tuple[str, Mapping[str, Any]]] = {
        "filter, causal": ("ekf_suspension", {"smooth": False}),
        "low-pass": ("lowpass_attitude", {"smooth": False}),
        "least squares": ("ls_attitude", {"smooth": False}),
    }

    def attitude(figure: Figure) -> None:
        for axes, case in zip(figure.subplots(2, 1), ("up9", "down12"), strict=True):
            _lines(axes, _run(f"wang2025-{case}", methods), "inclination")

    def fuel(figure: Figure) -> None:
        axes = figure.subplots()
        tilts = ("attitude", "attitude_accel", "specific_force")
        sources = {tilt: ("fuel_level", {"tilt_source": tilt}) for tilt in tilts}
        run = _run("wang2025-up9", sources)
        for label, estimate in run.estimates.items():
            volume = estimate.details["fuel"].columns["volume"]
            axes.plot(run.drive.time, volume, label=f"tilt by {label}")
        axes.axhline(20.0, color="k", label="truth")
        axes.set(xlabel="time [s]", ylabel="fuel [L]")
        axes.legend(fontsize="small")

    return [
        Drawing(
            "wang2025-attitude",
            "attitude, uphill and downhill",
            "Inclination uphill and downhill by the mended causal filter and both baselines. The "
            "shapes of both drives are ours: the paper prints them as pictures only.",
            attitude,
        ),
        Drawing(
            "wang2025-fuel",
            "fuel level",
            "20 L in a tank that tilts, by the filter's attitude as printed, by the same with "
            "dv/dt and by the IMU's specific force: the attitude alone forgets that fuel runs back "
            "when the car accelerates, by up to 7 L. With dv/dt it agrees with the IMU, as the "
            "paper's two levels do.",
            fuel,
        ),
    ]
