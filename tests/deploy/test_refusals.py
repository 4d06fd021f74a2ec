"""Who is not let in, and what an operator reads then."""

import itertools
import json
import shutil
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from deploy.secured_fleet import SecuredFleet, rendered, running_routers
from system.processes import wait_until

from noctule import bus, keys, tls
from noctule.bus_watch import BusWatch
from noctule.errors import BusError
from noctule.messages_pb2 import ServiceStatus

NO_SECRET = "PRIVATE KEY"


def refused(*connect: str, folder: Path | None = None) -> str:
    """What the command line would print."""
    with pytest.raises(BusError) as refusal:
        bus.open_session(connect, patience_s=0.0, tls_folder=folder)
    assert NO_SECRET not in str(refusal.value)
    return str(refusal.value)


@pytest.fixture(scope="module")
def strangers(tmp_path_factory: pytest.TempPathFactory) -> SecuredFleet:
    """The same names, from another authority."""
    return rendered(tmp_path_factory.mktemp("strangers"))


def test_a_router_of_another_authority_is_not_trusted(secured: SecuredFleet, strangers: SecuredFleet) -> None:
    told = refused(secured.endpoint(0), folder=strangers.folder("operator.anna.g1"))
    assert told.startswith("refused or unreachable: certificate?")
    assert "the router's certificate is not one to trust" in told


def test_a_certificate_of_another_authority_is_refused(
    secured: SecuredFleet, strangers: SecuredFleet, tmp_path: Path
) -> None:
    shutil.copytree(strangers.folder("operator.anna.g1"), tmp_path / "mixed")
    shutil.copy(secured.folder("operator.anna.g1") / tls.AUTHORITY, tmp_path / "mixed")
    assert "was not issued by the authority" in refused(secured.endpoint(0), folder=tmp_path / "mixed")


def test_without_a_certificate_nobody_gets_in(secured: SecuredFleet) -> None:
    told = refused(secured.endpoint(0))
    assert told.startswith("refused or unreachable: certificate?")
    assert "give --tls FOLDER" in told


def test_a_plain_connection_gets_nowhere(secured: SecuredFleet) -> None:
    told = refused(f"tcp/127.0.0.1:{secured.ports[0]}")
    assert told.startswith("refused or unreachable: certificate?")
    assert "takes no plain connection" in told


def test_a_folder_does_not_go_with_a_plain_endpoint(secured: SecuredFleet) -> None:
    told = refused("tcp/127.0.0.1:7447", folder=secured.folder("operator.anna.g1"))
    assert "would not use the certificate of operator.anna.g1: write tls/HOST:PORT" in told


def test_a_router_that_is_not_there_is_no_matter_of_certificates(strangers: SecuredFleet) -> None:
    told = refused(folder=strangers.folder("operator.anna.g1"))  # its routers do not run
    assert told.startswith(f"no router answers at {strangers.endpoint(0)}, {strangers.endpoint(1)}: start one")


def test_a_router_by_another_name_than_its_certificates_is_not_trusted(secured: SecuredFleet) -> None:
    told = refused(f"tls/localhost:{secured.ports[0]}", folder=secured.folder("operator.anna.g1"))
    assert "Hostname mismatch" in told


@pytest.mark.parametrize("generation", ["gateway.attic.g1", "gateway.attic.g2"])
def test_both_generations_of_a_name_that_is_being_renewed_may_publish(secured: SecuredFleet, generation: str) -> None:
    assert detail_once_it_has_looked(secured, generation, "house", "attic", wrong=False) == ""


def test_a_revoked_generation_is_told_that_nobody_reads_it(secured: SecuredFleet) -> None:
    told = detail_once_it_has_looked(secured, "service.alarm.g1", "house", "alarm")
    assert told.startswith("nobody reads what is published on noctule/@v1/house/service/alarm/status")
    assert "don't allow it to service.alarm.g1. Either this certificate was revoked" in told
    assert detail_once_it_has_looked(secured, "service.alarm.g2", "house", "alarm", wrong=False) == ""


def detail_once_it_has_looked(secured: SecuredFleet, common_name: str, site: str, name: str, wrong: bool = True) -> str:
    """What a service's status says once it has looked at its own path."""
    with secured.join(common_name) as session:
        state = bus.StatePublisher(session, keys.service_status(site, name), ServiceStatus)
        watch = BusWatch(session, tls_folder=secured.folder(common_name))
        watch.begin(lambda: [state])
        try:
            second = itertools.count()

            def has_seen_it() -> bool:
                state.put(ServiceStatus(site=site, name=name, counters={"second": next(second)}))
                return watch.looked.is_set() and bool(watch.detail()) == wrong

            # On a busy machine a session may be opened too late: that is said to be trouble, and tried again.
            wait_until(has_seen_it, "it sees it otherwise", every_s=1.0)
            return watch.detail()
        finally:
            watch.close()


def test_a_service_says_why_it_has_lost_its_router_and_when_it_is_read_again(tmp_path: Path) -> None:
    own = rendered(tmp_path)
    folder = own.folder("service.alarm.g1")
    with ExitStack() as closing:
        routers = closing.enter_context(ExitStack())
        routers.enter_context(running_routers(own))
        session = closing.enter_context(own.join("service.alarm.g1"))
        state = bus.StatePublisher(session, keys.service_status("house", "alarm"), ServiceStatus)
        watch = BusWatch(session, tls_folder=folder)
        watch.begin(lambda: [state])
        closing.callback(watch.close)

        def says(words: str) -> bool:
            state.put(ServiceStatus(site="house", name="alarm", counters={"put": time.monotonic_ns()}))
            return words in watch.detail() if words else watch.looked.is_set() and not watch.detail()

        wait_until(lambda: says(""), "its way was not open", every_s=0.5)
        routers.close()
        wait_until(lambda: says("the connection is lost: no router answers at tls/"), "not told", every_s=0.5)
        closing.enter_context(running_routers(own))
        wait_until(lambda: says(""), "it is not read again", every_s=0.5)


def test_a_router_that_does_not_tell_a_service_of_its_readers_is_found_out(tmp_path: Path) -> None:
    own = rendered(tmp_path)
    config_file = own.folder("router.one.g1") / tls.CONFIG
    config = json.loads(config_file.read_text())
    for rule in config["access_control"]["rules"]:
        if rule["flows"] == ["egress"] and rule["messages"] == ["declare_subscriber"]:
            rule["key_exprs"] = [keys.service_status("house", "alarm")]  # of itself: the readers' wildcard is not in it
    config_file.write_text(json.dumps(config))
    with bus.open_session(tls_folder=own.folder("router.one.g1")):
        assert "nobody reads" in detail_once_it_has_looked(own, "service.alarm.g1", "house", "alarm")


def test_a_certificate_that_expires_soon_stands_in_the_services_status_and_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    own = rendered(tmp_path, "valid_days = 29")
    with running_routers(own):
        told = detail_once_it_has_looked(own, "service.alarm.g1", "house", "alarm")
    assert told.startswith("the certificate of service.alarm.g1 expires on 20")
    assert [record.getMessage() for record in caplog.records if "expires on" in record.getMessage()] == [told]
