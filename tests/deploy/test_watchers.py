"""Viewers and readers see within ten seconds that a router drops what they publish, or hides what they read."""

import logging
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from deploy.secured_fleet import SecuredFleet
from system.processes import programs, wait_until, within_pauses

from noctule import bus, keys
from noctule.client import Client
from noctule.messages_pb2 import LogRecords, ServiceStatus
from noctule.read_watch import ReadWatch
from noctule_viewer.board.site_state import SiteState
from noctule_viewer.presence import Presence

WITHIN_S = 10.0


@contextmanager
def shown(secured: SecuredFleet, site: str, name: str) -> Iterator[Presence]:
    with Presence(site, SiteState(), tls_folder=secured.folder(name)) as presence:
        presence.put(ServiceStatus(role="viewer"))
        yield presence


def test_a_viewer_is_seen_at_its_own_site(secured: SecuredFleet) -> None:
    with (
        secured.join("operator.anna.g1") as session,
        Client("house", session=session) as client,
        shown(secured, "house", "viewer.screen.g1"),
    ):
        got: list[ServiceStatus] = []
        client.on_service_status(got.append)
        wait_until(lambda: got, "the viewer is not seen")
        assert (got[0].site, got[0].name, got[0].detail) == ("house", "screen", "")


def test_a_viewer_of_another_site_says_within_ten_seconds_that_nobody_reads_it(
    secured: SecuredFleet, caplog: pytest.LogCaptureFixture
) -> None:
    with shown(secured, "farm", "viewer.screen.g1") as presence:

        def told() -> bool:
            presence.put(ServiceStatus(role="viewer", counters={"put": time.monotonic_ns()}))
            return "nobody reads what is published on noctule/@v1/farm/service/screen/status" in caplog.text

        within_pauses(told, "the viewer did not see it", WITHIN_S)
        assert "don't allow it to viewer.screen.g1. Either this certificate was revoked" in caplog.text


@contextmanager
def unit_at(secured: SecuredFleet, has_log: bool = True) -> Iterator[None]:
    """What a gateway has on the bus of unit u1 of the site "house": its token, and its log."""
    with secured.join("gateway.attic.g2") as session:
        token = session.liveliness().declare_token(keys.alive("house", "u1"))
        key = keys.log("house", "u1")
        answer = LogRecords(log_id="a", head=0, tail=1).SerializeToString()
        if has_log:
            session.declare_queryable(key, lambda query: query.reply(key, answer, encoding=bus.encoding(LogRecords)))
        yield
        token.undeclare()


@contextmanager
def reading(secured: SecuredFleet, name: str) -> Iterator[ReadWatch]:
    with ExitStack() as closing:
        session = closing.enter_context(secured.join(name))
        client = closing.enter_context(Client("house", session=session))
        watch = ReadWatch(client, tls_folder=secured.folder(name))
        watch.begin()
        closing.callback(watch.close)
        yield watch


def test_a_reader_that_may_read_nothing_says_so_within_ten_seconds(secured: SecuredFleet) -> None:
    with unit_at(secured), reading(secured, "service.alarm.g1") as revoked:
        within_pauses(lambda: revoked.trouble, "the reader did not see it", WITHIN_S)
        assert revoked.trouble.startswith(
            "no unit of site 'house' is seen: either no gateway of it is up, or the rules"
        )
        assert "don't allow it to service.alarm.g1: this certificate was revoked" in revoked.trouble


def test_a_reader_that_sees_a_unit_whose_log_it_may_not_read_names_the_unit(secured: SecuredFleet) -> None:
    with unit_at(secured, has_log=False), reading(secured, "viewer.screen.g1") as viewer:
        wait_until(lambda: viewer.trouble, "the reader did not see it")
        assert viewer.trouble.startswith("the logs of u1 can't be read: the rules of the router at tls/")


def test_a_reader_says_when_its_site_can_be_read_again(secured: SecuredFleet, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING), reading(secured, "viewer.screen.g1") as viewer:
        wait_until(lambda: viewer.trouble, "the reader did not see it")
        with unit_at(secured):
            wait_until(lambda: "site 'house' is read again" in caplog.text, "it was not told")


def test_a_recording_says_that_its_site_is_hidden(secured: SecuredFleet, tmp_path: Path) -> None:
    with programs(tmp_path) as running:
        folder = str(secured.folder("service.alarm.g1"))
        running.start("record", "noctule", "record", "house", str(tmp_path / "sweeps.jsonl"), "--tls", folder)
        wait_until(lambda: "don't allow it to service.alarm.g1" in running.log("record"), "it was not told")
        running.end("record")
