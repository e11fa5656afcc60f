"""The pages in a real browser: headless Chromium, offline."""

import base64
import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import browsers
from support.drives import hill_tables, table

from roadlog.car.vehicle import Vehicle
from roadlog.log import create
from roadlog.report.batch import Workers
from roadlog.report.page import write_assets, write_index
from roadlog.report.row import Options, empty_row
from roadlog.report.run import finish, output_folder, run
from roadlog.report.sources import FoundLog, find

HOSTILE = "<img src=x onerror=alert(1)>.mcap"
OPTIONS = Options(("kmbe", "lowpass_attitude", "ls_window"))
pytestmark = pytest.mark.needs_browser


def in_threads(jobs: int = 1) -> Workers:
    """The seam is an Workers, so a thread does as well as a cluster."""
    executor = ThreadPoolExecutor(jobs)
    return Workers(executor, jobs, lambda: None, executor.shutdown)


def positions(duration: float, offset: float = 0.0) -> Any:
    """GNSS of a drive to the east along 48 deg north, as fast as `hill_tables`."""
    time = hill_tables(duration, rate=5.0)[0].time
    t = (time - time[0]) * 1e-9
    distance = 12 * t + 4 * 17 / (2 * np.pi) * (1 - np.cos(2 * np.pi * t / 17))
    east = np.degrees(distance / (6_371_008.8 * np.cos(np.radians(48.0))))
    north = np.full(len(t), 48.0 + np.degrees(offset / 6_371_008.8))
    return table("gnss", time, {"latitude": north, "longitude": 11.0 + east})


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five good drives, one of them with a hostile name, and two that fail."""
    logs = tmp_path_factory.mktemp("logs")
    folder = tmp_path_factory.mktemp("report")
    for k in range(5):
        name = HOSTILE if k == 4 else f"drive{k}.mcap"
        tables = [*hill_tables(30.0, rate=50.0, seed=k), positions(30.0, offset=float(k))]
        car = Vehicle().with_values(name=f"car<b>{k % 2}</b>")
        create(logs / name, tables, vehicle=car)
    (logs / "</script><script>alert(2)</script>.mcap".replace("/", "\u2215")).write_bytes(b"")
    (logs / "broken.mcap").write_bytes(b"<b>no log</b>")
    with output_folder(str(folder), fetch=False):
        rows, _ = run(find([str(logs)]), OPTIONS, folder, in_threads)
        finish(rows, OPTIONS, folder)
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Headless Chromium by Selenium, with its console and its requests recorded."""
    options = browsers.options("--disable-gpu", "--disable-dev-shm-usage")
    options.add_argument("--window-size=1300,1600")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with browsers.opened(options) as browser:
        yield browser


@pytest.fixture
def page(browser: Any) -> Iterator[Callable[[Path], Any]]:
    """Open a page; at the end nothing is on the console and nothing was asked of the outside."""

    def open_page(path: Path) -> Any:
        browser.get(path.as_uri())
        return browser

    browser.get("about:blank")
    browser.get_log("browser"), browser.get_log("performance")
    yield open_page
    assert browser.get_log("browser") == []
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    urls = {
        event["params"]["request"]["url"]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    }
    assert urls
    assert all(url.startswith(("file:", "data:", "blob:")) for url in urls), urls


def texts(browser: Any, selector: str) -> list[str]:
    script = "return [...document.querySelectorAll(arguments[0])].map((e) => e.textContent)"
    return browser.execute_script(script, selector)


def choose(browser: Any, control: str, text: str) -> None:
    """Set a select by its text, or a text field, as a person does."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import Select

    found = browser.find_element(By.ID, control)
    if found.tag_name == "select":
        Select(found).select_by_visible_text(text)
    else:
        found.clear()
        found.send_keys(text)


def click(browser: Any, selector: str) -> None:
    from selenium.webdriver.common.by import By

    browser.find_element(By.CSS_SELECTOR, selector).click()


def test_index_ranks_sorts_and_filters(report: Path, page: Callable[[Path], Any]) -> None:
    opened = page(report / "index.html")
    assert texts(opened, "#count") == ["7 logs"]
    assert texts(opened, "#facts div") == [
        "7logs",
        "5ok",
        "2failed",
        "0crashed",
        "0.0hours",
        "1.8km",
    ]
    ranking = texts(opened, "#ranking tbody tr td:first-child")
    assert set(ranking) == {"kmbe", "ls_window"}
    assert texts(opened, "#distribution svg .boxlayer .trace path.box")
    rmse = [float(text) for text in texts(opened, "#drives tbody td:nth-child(7)") if text != "–"]
    assert len(rmse) == 5
    assert rmse == sorted(rmse, reverse=True)
    click(opened, "#drives th:nth-child(7) button")
    again = [float(text) for text in texts(opened, "#drives tbody td:nth-child(7)") if text != "–"]
    assert again == sorted(rmse)
    click(opened, "#drives th:nth-child(1) button")
    names = texts(opened, "#drives tbody td:first-child")
    assert names[-3:] == ["drive1.mcap", "drive2.mcap", "drive3.mcap"]
    choose(opened, "vehicle", "car<b>1</b>")
    assert texts(opened, "#count") == ["2 of 7 logs"]
    click(opened, "#reset")
    choose(opened, "status", "failed")
    assert len(texts(opened, "#drives tbody tr")) == 2
    click(opened, "#reset")
    choose(opened, "text", "DRIVE2")
    assert texts(opened, "#drives tbody td:first-child") == ["drive2.mcap"]
    click(opened, "#reset")
    choose(opened, "angle", "inclination")
    choose(opened, "estimator", "lowpass_attitude")
    assert texts(opened, "#count") == ["5 of 7 logs"]


def test_slopes_in_percent(report: Path, page: Callable[[Path], Any]) -> None:
    opened = page(report / "index.html")
    sizes = "#drives tbody td:nth-child(7)"
    degrees = [float(text) for text in texts(opened, sizes) if text != "–"]
    choose(opened, "slope", "percent")
    percents = [float(text) for text in texts(opened, sizes) if text != "–"]
    np.testing.assert_allclose(percents, np.multiply(degrees, 100 * np.pi / 180), rtol=0.02)
    assert "%" in texts(opened, "#drives th:nth-child(7)")[0]
    assert "grade, %" in " ".join(texts(opened, "#road-curves svg .ytitle"))
    click(opened, "#drives tbody tr:first-child a")
    assert texts(opened, "#curves svg .ytitle")[:1] == ["grade, %"]
    assert "%" in texts(opened, "#figures tbody td:nth-child(3)")
    choose(opened, "angle", "inclination")
    assert texts(opened, "#curves svg .ytitle")[:1] == ["inclination, deg"]


def test_texts_of_logs_are_only_texts(report: Path, page: Callable[[Path], Any]) -> None:
    opened = page(report / "index.html")
    assert HOSTILE in texts(opened, "#drives tbody td:first-child")
    assert len(texts(opened, "#failures tbody tr")) == 2
    assert any("alert(2)" in text for text in texts(opened, "#failures tbody td:first-child"))
    assert not texts(opened, "img, b:not(.facts b), table script")
    data = json.loads(texts(opened, "#data")[0])
    hostile = data["logs"]["name"].index(HOSTILE)
    opened = page(report / data["logs"]["detail"][hostile])
    assert texts(opened, "h1") == [HOSTILE]
    assert opened.title == HOSTILE
    assert not texts(opened, "img, table script")


def test_detail_page_shows_plots_and_map(report: Path, page: Callable[[Path], Any]) -> None:
    opened = page(report / "index.html")
    click(opened, "#drives tbody tr:first-child a")
    assert "/details/" in opened.current_url
    lines = "#curves svg .scatterlayer .trace path.js-line"
    assert len(texts(opened, lines)) >= 3
    assert texts(opened, "#curves svg .legendtext")[0] == "kmbe"
    assert len(texts(opened, "#map svg .points path")) > 100
    assert texts(opened, "#histogram svg .scatterlayer .trace path.js-line")
    buttons = "return [...document.querySelectorAll('.modebar-btn')].map((b) => b.dataset.title)"
    assert not [t for t in opened.execute_script(buttons) if "loud" in t or "hare" in t]
    choose(opened, "angle", "inclination")
    assert "lowpass_attitude" in texts(opened, "#curves svg .legendtext")
    rows = texts(opened, "#figures tbody td:nth-child(2)")
    assert {"kmbe", "lowpass_attitude", "ls_window"} <= set(rows)


def test_road_profile_is_on_the_map(report: Path, page: Callable[[Path], Any]) -> None:
    opened = page(report / "index.html")
    assert len(texts(opened, "#roads svg .points path")) > 20


def test_page_follows_the_systems_colors(report: Path, page: Callable[[Path], Any]) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    opened = page(report / "index.html")
    color = "return getComputedStyle(document.body).backgroundColor"
    plot = "return document.querySelector('#distribution')._fullLayout.paper_bgcolor"
    shades = {"light": ["rgb(255, 255, 255)", "#ffffff"], "dark": ["rgb(20, 23, 26)", "#14171a"]}
    for scheme, shade in shades.items():
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        # the browser tells the page at its next frame
        WebDriverWait(opened, 30).until(
            lambda tab, shade=shade: [tab.execute_script(s) for s in (color, plot)] == shade
        )
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def synthetic_rows(count: int, seed: int = 1) -> list[dict[str, Any]]:
    """Rows as `run` makes them, from chance."""
    rng = np.random.default_rng(seed)
    estimators = ("fusion", "kmbe", "debe", "ekf_suspension", "lowpass_attitude")
    rows = []
    for k in range(count):
        source = FoundLog(f"/fleet/{k % 97:02d}/{k:06d}.mcap", f"{k % 97:02d}/{k:06d}.mcap", 1, "1")
        row = empty_row(source, Options())
        if k % 50 == 0:
            rows.append(row | {"status": "failed", "message": f"no signal {k}"})
            continue
        row |= {"vehicle": f"car {k % 30}", "road": f"road {k % 200}", "estimators": [*estimators]}
        row |= {"duration_s": 60.0 + k % 1000, "distance_m": 1000.0, "seconds": {"total": 1.0}}
        row["detail"] = f"details/{k}.html"
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


def test_twenty_thousand_logs(tmp_path: Path, page: Callable[[Path], Any]) -> None:
    write_assets(tmp_path)
    write_index(tmp_path, synthetic_rows(20_000), Options())
    opened = page(tmp_path / "index.html")
    assert texts(opened, "#count") == ["20000 logs"]
    assert len(texts(opened, "#drives tbody tr")) == 100
    assert "1–100 of 400" in texts(opened, "#failures .pager")[0]
    choose(opened, "vehicle", "car 7")
    assert texts(opened, "#count") == ["667 of 20000 logs"]


def test_a_printed_table_repeats_its_heading(tmp_path: Path, page: Callable[[Path], Any]) -> None:
    """On each page that it goes over."""
    if shutil.which("pdftotext") is None:
        pytest.skip("needs_browser: poppler-utils is not installed")
    write_assets(tmp_path)
    write_index(tmp_path, synthetic_rows(120), Options())
    printed = tmp_path / "page.pdf"
    printed.write_bytes(base64.b64decode(page(tmp_path / "index.html").print_page()))
    command = ["pdftotext", "-layout", printed, "-"]
    text = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    with_drives = [sheet for sheet in text.split("\f") if sheet.count(".mcap") > 5]
    assert len(with_drives) > 2
    assert all("warnings" in sheet for sheet in with_drives[:3])


def test_one_file_needs_no_other(tmp_path: Path, page: Callable[[Path], Any]) -> None:
    write_index(tmp_path, synthetic_rows(50), Options(), one_file=True)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    opened = page(tmp_path / "report.html")
    assert texts(opened, "#count") == ["50 logs"]
    assert texts(opened, "#distribution svg .boxlayer .trace path.box")
    assert not texts(opened, "#drives a")
