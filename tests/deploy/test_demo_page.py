"""The demo says which page to open once that page can be loaded, and not before."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from run import announce_page

NOT_YET = 2


class Page(BaseHTTPRequestHandler):
    """A page that can't be loaded the first times it is asked for."""

    asked = 0

    def do_GET(self) -> None:
        Page.asked += 1
        self.send_response(503 if Page.asked <= NOT_YET else 200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture
def web_port() -> Iterator[int]:
    with HTTPServer(("127.0.0.1", 0), Page) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


def test_the_address_is_said_once_when_the_page_answers(web_port: int) -> None:
    said: list[tuple[str, int]] = []
    settings = {"DEMO_RERUN_PORT": "9876", "DEMO_WEB_PORT": str(web_port)}
    announce_page(settings, lambda line: said.append((line, Page.asked)))
    assert [asked for _, asked in said] == [NOT_YET + 1]
    assert f"http://127.0.0.1:{web_port}/" in said[0][0]
