"""A gateway gives its units only firmware that a known key has signed; every other image is refused with the reason."""

import logging
import struct
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from gateway.model_unit import ModelUnit
from gateway.tcp_unit import TcpUnit, tcp_unit
from system.processes import PATIENCE_S, free_ports, wait_until

from noctule import bus, bus_config, firmware_signature
from noctule.client import Client
from noctule.firmware_rules import FirmwareRules
from noctule.firmware_signature import PublicKey
from noctule.messages_pb2 import CommandRequest
from noctule.site import load
from noctule_gateway.service import Gateway
from noctule_gateway.update.admission import Admission
from noctule_gateway.wire import frames

# Where the description lies, and what is in it: firmware/README.md, "Flash".
APPLICATION, DESCRIPTION = 0x1000, 0x8000 - 32
RELEASE, STRANGER = Ed25519PrivateKey.generate(), Ed25519PrivateKey.generate()
KEY = PublicKey("release", RELEASE.public_key().public_bytes_raw())
SITE = """
site = "bench"
[[unit]]
name = "u1"
serial = 7
address = "{address}"
pose = {{ x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }}
"""


def image(*version: int) -> bytes:
    """An image of four bytes that describes itself."""
    content = b"\x02\x10\x00\x00"
    head = struct.pack("<HB3BHI", 0x4E49, 1, *version, len(content), zlib.crc32(content))
    described = head + struct.pack("<I", zlib.crc32(head))
    return (record(APPLICATION, content) + record(DESCRIPTION, described) + ":00000001FF\n").encode()


def record(address: int, data: bytes) -> str:
    body = bytes([len(data), address >> 8, address & 0xFF, 0]) + data
    return f":{(body + bytes([-sum(body) & 0xFF])).hex()}\n"


@dataclass
class Bench:
    """A unit, and an operator of the gateway that serves it."""

    line: TcpUnit
    client: Client

    def update(self, data: bytes) -> str:
        """Why the image was refused."""
        reply = self.client.command("u1", "update", CommandRequest(image=data, force=True), timeout_s=PATIENCE_S)
        assert not reply.done
        return reply.error


@pytest.fixture
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    """A gateway with the admission that the test is parametrized by."""
    (port,) = free_ports(1)
    with (
        tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line,
        bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as session,
    ):
        site = tmp_path / "site.toml"
        site.write_text(SITE.format(address=line.address))
        gateway = Gateway(load(site), tmp_path / "data", admission=request.param)
        gateway.start()
        gateway.join(session)
        try:
            with Client("bench", session=session) as client:
                wait_until(lambda: line.unit.carried_out, "the unit was not connected")
                yield Bench(line, client)
        finally:
            gateway.close()


SIGNED = firmware_signature.sign(image(0, 9, 0), RELEASE)
REFUSED = {
    "not signed": (image(0, 9, 0), "the image was not taken: it is not signed: sign it (noctule-deploy firmware-sign)"),
    "signed by a stranger": (firmware_signature.sign(image(0, 9, 0), STRANGER), "is not known here; keys that are: "),
    "signed before it was changed": (
        SIGNED.replace(image(0, 9, 0), image(0, 9, 1)),
        f"it is not what release ({KEY.id}) has signed: it was changed after that",
    ),
    "older than allowed": (
        firmware_signature.sign(image(0, 8, 255), RELEASE),
        "it is version 0.8.255, and 0.9.0 is the oldest that is allowed",
    ),
    "cut in its signature": (SIGNED[:-10], "is cut or damaged: copy the file again"),
    "cut before its end": (SIGNED.partition(b"\n")[0], "the image is cut off: it has no end record"),
    "cut in a line": (SIGNED[:60], "is no record of Intel HEX, or is cut"),
}
STRICT = Admission(FirmwareRules((KEY,), (0, 9, 0)))


@pytest.mark.parametrize("bench", [STRICT], indirect=True)
def test_every_image_that_the_rules_do_not_allow_is_refused_and_the_signed_one_is_sent(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    for name, (data, words) in REFUSED.items():
        assert words in bench.update(data), name
    with bench.line.lock:
        assert not any(isinstance(each, frames.Update) for each in bench.line.unit.carried_out)
    with caplog.at_level(logging.INFO):
        # The model has no loader, so the update itself comes to nothing.
        bench.client.session.get(
            "noctule/@v1/bench/unit/u1/@rpc/update",
            lambda _: None,
            payload=CommandRequest(request_id="signed", image=SIGNED).SerializeToString(),
        )
        began = f"u1: its firmware is being updated to 0.9.0; signed by release ({KEY.id})"
        wait_until(lambda: began in caplog.text, "the signed image was not sent")


@pytest.mark.parametrize("bench", [Admission()], indirect=True)
def test_a_gateway_without_keys_on_a_bus_that_others_reach_refuses_all_images(bench: Bench) -> None:
    for data in (image(0, 9, 0), SIGNED):
        assert "the image was not taken: there are no firmware keys. Add them to the fleet file" in bench.update(data)


@pytest.mark.parametrize("bench", [Admission(takes_unsigned=True)], indirect=True)
def test_without_keys_on_a_bus_of_this_host_alone_an_image_is_taken_and_the_log_says_that_nobody_checked_it(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    assert "or is cut" in bench.update(image(0, 9, 0)[:30])
    with caplog.at_level(logging.INFO):
        bench.client.session.get(
            "noctule/@v1/bench/unit/u1/@rpc/update",
            lambda _: None,
            payload=CommandRequest(request_id="unsigned", image=image(0, 9, 0)).SerializeToString(),
        )
        began = "u1: its firmware is being updated to 0.9.0; signatures are not checked, because there are no firmware"
        wait_until(lambda: began in caplog.text, "the image was not sent")


@pytest.mark.parametrize(
    ("connect", "listen", "local"),
    [
        ([], ["tcp/127.0.0.1:7447"], True),
        (["tcp/localhost:7447"], [], False),  # where that router listens can't be seen
        ([], [], False),
        ([], ["tcp/0.0.0.0:7447"], False),
        (["tcp/127.0.0.1:7447", "tcp/router-1:7447"], [], False),
    ],
)
def test_a_bus_is_local_where_the_session_is_its_router_and_listens_on_loopback(
    connect: list[str], listen: list[str], local: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NOCTULE_TLS", raising=False)
    assert bus_config.is_local(connect, listen, None) is local
