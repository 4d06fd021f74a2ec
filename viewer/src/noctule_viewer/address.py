"""Where a relay is: the addresses at which mappers, native viewers and browsers reach it."""

from urllib.parse import quote

DEFAULT_BIND, DEFAULT_PORT, DEFAULT_WEB_PORT = "127.0.0.1", 9876, 9090


def url(bind: str, port: int) -> str:
    """Where mappers and native viewers connect to."""
    return f"rerun+http://{bind}:{port}/proxy"


def page(bind: str, port: int, web_port: int) -> str:
    """What to open in a browser."""
    return f"http://{bind}:{web_port}/?url={quote(url(bind, port), safe='')}"


DEFAULT_URL = url(DEFAULT_BIND, DEFAULT_PORT)
DEFAULT_PAGE = page(DEFAULT_BIND, DEFAULT_PORT, DEFAULT_WEB_PORT)
