"""Headless Chromium that shows a page: what the page draws, and what it complains of. It reaches this machine alone."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, Route, sync_playwright
from system.processes import PATIENCE_S

CHROMIUM = "/usr/bin/chromium"
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
WIDTH_PX, HEIGHT_PX = 960, 600
SHOWN_WITHIN_S = 300.0
"""How long a test waits for what a page shows: to load one takes some 20 s of a processor that may be shared."""
_HERE = ("http://127.0.0.1:", "https://localhost:", "data:", "blob:")


class Screen:
    """A page as somebody sees it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self._complaints: list[str] = []
        page.on("console", self._note)
        page.on("pageerror", lambda error: self._complaints.append(str(error)))

    def open(self, address: str) -> None:
        """Load ``address``; the viewer draws by WebGL, which software can do."""
        self.page.goto(f"{address}&renderer=webgl")

    def picture(self) -> np.ndarray:
        """What is shown now, (height, width, 3) bytes."""
        return np.array(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"))

    def wait_for(
        self, condition: Callable[[], bool], what: str, every_s: float = 1.0, within_s: float = SHOWN_WITHIN_S
    ) -> None:
        """Call ``condition`` until it is true; fail with ``what`` when time is up.

        Each request of the page waits for this thread to let it go (``_refuse``), so this thread must not sleep.
        """
        deadline_s = monotonic() + within_s
        while not condition():
            assert monotonic() < deadline_s, f"{what} (waited {within_s:g} s)"
            self.page.wait_for_timeout(1e3 * every_s)

    def complaints(self) -> list[str]:
        """Errors that Rerun's viewer has written to the console, and those that nothing has caught."""
        return list(self._complaints)

    def _note(self, message: ConsoleMessage) -> None:
        # What the content security policy forbids is an error to the browser, and wanted.
        if message.type == "error" and message.text.lstrip().startswith("ERROR"):
            self._complaints.append(message.text)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser without a screen and without a graphics card."""
    flags = ["--no-sandbox", *SOFTWARE_GL]
    with (
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=CHROMIUM, args=flags, timeout=1e3 * PATIENCE_S) as made,
    ):
        yield made


@contextmanager
def screen(
    browser: Browser, login: tuple[str, str] | None = None, size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX)
) -> Iterator[Screen]:
    """An empty page. With ``login`` it knows a name and a password, and takes whatever certificate is shown to it."""
    context = browser.new_context(
        viewport={"width": size_px[0], "height": size_px[1]},
        http_credentials={"username": login[0], "password": login[1]} if login else None,
        ignore_https_errors=login is not None,
    )
    try:
        context.set_default_timeout(1e3 * SHOWN_WITHIN_S)
        context.route(lambda url: not url.startswith(_HERE), _refuse)
        yield Screen(context.new_page())
    finally:
        context.close()


def _refuse(route: Route, _request: Request) -> None:
    route.abort()
