"""A real browser, for what only a browser shows. Its tests are marked `needs_browser`."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


def options(*arguments: str) -> Any:
    """Of a Chromium without a window; skips where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs_browser: no selenium")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None or shutil.which("chromedriver") is None:
        pytest.skip("needs_browser: chromium or chromedriver is not installed")
    made = webdriver.ChromeOptions()
    made.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", *arguments):
        made.add_argument(argument)
    return made


@contextmanager
def opened(options: Any) -> Iterator[Any]:
    """The browser, until the block ends."""
    from selenium import webdriver

    service = webdriver.ChromeService(shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=service)
    try:
        yield browser
    finally:
        browser.quit()
