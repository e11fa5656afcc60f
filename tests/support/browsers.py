"""A real browser, for what only a browser shows. Its tests are marked `needs_browser`."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
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


def letters(rgb: np.ndarray) -> str:
    """What tesseract reads in a line of a picture, (rows, columns, 3) from 0 to 1; `alike`."""
    from matplotlib.image import imsave

    if shutil.which("tesseract") is None:
        pytest.skip("needs_browser: tesseract is not installed")
    large, file = rgb.repeat(4, axis=0).repeat(4, axis=1), io.BytesIO()
    imsave(file, large, format="png")
    command = ["tesseract", "stdin", "stdout", "--psm", "7"]
    done = subprocess.run(command, input=file.getvalue(), capture_output=True, check=True)
    return alike(done.stdout.decode())


def alike(text: str) -> str:
    """A text whose letters that look the same in print are the same."""
    return text.lower().translate(str.maketrans("l1|", "iii"))
