"""A relay that answers no more is known as dead after three looks, and since its last answer."""

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

from noctule_viewer.pulse import Pulse


class Answering(BaseHTTPRequestHandler):
    """A relay's web server that is well."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass


def test_a_relay_is_silent_since_its_last_answer_not_since_the_third_look_that_failed() -> None:
    now_s = 100.0
    with HTTPServer(("127.0.0.1", 0), Answering) as server:
        serving = threading.Thread(target=server.serve_forever, daemon=True)
        serving.start()
        pulse = Pulse("127.0.0.1", server.server_address[1], lambda: now_s)
        now_s += 10.0
        pulse.feel()
        assert (pulse.looks, pulse.failed) == (1, 0)
        server.shutdown()
        serving.join()
    for _ in range(2):
        now_s += 10.0
        pulse.feel()
        assert pulse.silent_s == 0.0
    now_s += 10.0
    pulse.feel()
    assert not pulse.beats
    now_s += 2.0  # until a page asks
    assert pulse.silent_s == 32.0
