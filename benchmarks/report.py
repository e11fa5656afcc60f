"""Reports: workers, overhead, an hour of driving, memory, growth, and the page in a browser.

Run: python benchmarks/report.py
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.log import create
from roadlog.report.batch import Workers, local_workers
from roadlog.report.page import write_assets, write_index
from roadlog.report.row import Options, empty_row
from roadlog.report.run import finish, output_folder, run
from roadlog.report.sources import FoundLog, find
from roadlog.simulate import Simulation, simulate
from roadlog.storage import Table

HOUR = 3600.0  # s
SECOND_NS = 10**9


def write(path: Path, simulation: Simulation, copies: int = 1, seconds: float = np.inf) -> None:
    """A log of the simulated drive: its first seconds, or the drive again and again."""
    period = int(simulation.motion.time[-1] * SECOND_NS) + SECOND_NS
    tables = []
    for table in simulation.tables:
        kept = table.time - table.time[0] <= seconds * 1e9
        stamps = [table.time[kept] + k * period for k in range(copies)]
        columns = {name: np.tile(values[kept], copies) for name, values in table.columns.items()}
        tables.append(Table(table.topic, table.schema, np.concatenate(stamps), columns))
    create(path, tables, simulation.metadata, simulation.vehicle)


def copies_of(log: Path, count: int) -> Path:
    """A folder with copies of a log."""
    folder = log.parent / f"{log.stem}-{count}"
    folder.mkdir()
    for k in range(count):
        shutil.copy(log, folder / f"{k:05d}.mcap")
    return folder


@contextmanager
def kept(jobs: int, warm_up: FoundLog, options: Options) -> Iterator[Callable[[], Workers]]:
    """An engine whose processes have started, and compiled what they need, before it counts."""
    engine = local_workers(jobs)
    futures: list[Future] = []
    from roadlog.report.row import run_log

    futures = [engine.executor.submit(run_log, warm_up, options) for _ in range(jobs)]
    for future in futures:
        future.result()
    yield lambda: replace(engine, close=lambda: None)
    engine.close()


def timed(folder: Path, jobs: int, options: Options, tables: bool = False) -> dict[str, float]:
    """Wall s; a log's CPU of the worker and of the parent, and time with nothing to do, in ms."""
    sources = find([str(folder)])
    with (
        tempfile.TemporaryDirectory() as out,
        output_folder(out, fetch=False) as report,
        kept(jobs, sources[0], options) as engine,
    ):
        wall, cpu = time.perf_counter(), time.process_time()
        rows, _ = run(sources, options, report, engine)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        ending = time.perf_counter()
        if tables:
            finish(rows, options, report)
        ending = time.perf_counter() - ending
    assert all(row["status"] == "ok" for row in rows), rows[0]["message"]
    busy = sum(row["seconds"]["total"] for row in rows)
    return {
        "wall_s": wall,
        "end_s": ending,
        "per_log_ms": 1e3 * wall / len(rows),
        "worker_cpu_ms": 1e3 * sum(row["seconds"]["cpu"] for row in rows) / len(rows),
        "parent_cpu_ms": 1e3 * cpu / len(rows),
        "idle_ms": 1e3 * (jobs * wall - busy) / len(rows),
        "peak_memory_mb": max(row["peak_memory_mb"] for row in rows),
    }


def one_hour(log: Path, short: Path) -> dict[str, float]:
    """Every estimator on an hour, in a process that has compiled them before."""
    options = Options()
    (hour,), (warm_up,) = find([str(log)]), find([str(short)])
    from roadlog.report.row import run_log

    with kept(1, warm_up, options) as engine:
        row = engine().executor.submit(run_log, hour, options).result().row
    assert row["status"] == "ok", row["message"]
    return {**row["seconds"], "estimators": len(row["estimators"]), "mb": row["peak_memory_mb"]}


def synthetic_rows(count: int) -> list[dict[str, Any]]:
    """Rows as `run` makes them, from chance."""
    rng = np.random.default_rng(1)
    estimators = ("fusion", "kmbe", "debe", "ekf_suspension", "lowpass_attitude")
    rows = []
    for k in range(count):
        source = FoundLog(f"/fleet/{k % 97:02d}/{k:06d}.mcap", f"{k % 97:02d}/{k:06d}.mcap", 1, "1")
        row = empty_row(source, Options()) | {"estimators": list(estimators)}
        row |= {"vehicle": f"car {k % 30}", "road": f"road {k % 200}", "duration_s": 60.0 + k % 999}
        row |= {"distance_m": 1000.0, "seconds": {"total": 1.0}, "detail": f"details/{k}.html"}
        row["angles"] = {
            name: {
                angle: {
                    "rmse_deg": round(float(rng.lognormal(-1, 0.6)), 5),
                    "bias_deg": 0.01,
                    "within_2sd": 0.95,
                    "valid_share": 0.99,
                }
                for angle in ("grade", "inclination", "pitch")
            }
            for name in estimators
        }
        rows.append(row)
    return rows


def in_browser(count: int) -> dict[str, float] | None:
    """s to open the index and to filter it, in headless Chromium; None without one.

    Wall s, and CPU s of the drawing process, which other work on the machine does not change.
    """
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        return None
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_assets(folder)
        started = time.perf_counter()
        write_index(folder, synthetic_rows(count), Options())
        made = time.perf_counter() - started
        pid = browser.service.process.pid
        busy = [_renderer_cpu(pid)]
        browser.get((folder / "index.html").as_uri())
        opened = browser.execute_script(
            "return performance.getEntriesByType('navigation')[0].loadEventEnd"
        )
        rows = browser.execute_script("return performance.getEntriesByName('rows')[0].startTime")
        busy.append(_renderer_cpu(pid))
        filtered = browser.execute_script(
            "const t = performance.now(); byId('text').value = '/fleet/07'; update();"
            "document.body.offsetHeight; return performance.now() - t"
        )
        busy.append(_renderer_cpu(pid))
        size = (folder / "index.html").stat().st_size / 1e6
    browser.quit()
    return {
        "logs": count,
        "page_mb": size,
        "write_s": made,
        "rows_s": rows / 1e3,
        "open_s": opened / 1e3,
        "open_cpu_s": busy[1] - busy[0],
        "filter_s": filtered / 1e3,
        "filter_cpu_s": busy[2] - busy[1],
    }


def _renderer_cpu(driver: int) -> float:
    """CPU s so far of the processes that draw pages, of the browser that a driver started."""
    stats = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            command = path.with_name("cmdline").read_bytes()
            ticks = int(fields[11]) + int(fields[12])
            stats[int(path.parent.name)] = (int(fields[1]), b"--type=renderer" in command, ticks)
    total = 0
    for parent, draws, ticks in stats.values():
        while draws and parent in stats and parent != driver:
            parent = stats[parent][0]
        total += ticks if draws and parent == driver else 0
    return total / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print everything as JSON."""
    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulation = simulate("mountain")
        short, tiny, hour = (folder / f"{n}.mcap" for n in ("short", "tiny", "hour"))
        write(short, simulation, seconds=60.0)
        write(tiny, simulation, seconds=10.0)
        write(hour, simulation, copies=round(HOUR / simulation.motion.time[-1]))

        work = Options(("fusion", "kmbe", "debe"))
        logs = copies_of(short, 16)
        one, two = (timed(logs, jobs, work) for jobs in (1, 2))
        result["workers"] = {"one": one, "two": two, "times": one["wall_s"] / two["wall_s"]}

        light = Options(("lowpass_attitude",))
        result["growth"] = {
            count: timed(copies_of(tiny, count), 2, light, tables=True) for count in (10, 100, 1000)
        }
        result["hour"] = one_hour(hour, short)
    result["browser"] = in_browser(20_000)
    print(json.dumps(result, indent=2, default=float))


if __name__ == "__main__":
    main()
