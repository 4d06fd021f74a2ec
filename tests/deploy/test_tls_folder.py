"""A folder of certificate and key is checked before Zenoh sees it, and what is wrong is said in words."""

import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from deploy.secured_fleet import SecuredFleet, rendered

from noctule import tls
from noctule.errors import TlsError
from noctule.expiry_watch import ExpiryWatch

MADE = datetime(2026, 3, 1, 12, tzinfo=UTC)
NAME = "gateway.attic.g1"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> SecuredFleet:
    """A fleet whose certificates are good for 100 days from MADE on."""
    return rendered(tmp_path_factory.mktemp("fleet"), "valid_days = 100", MADE)


@pytest.fixture
def folder(made: SecuredFleet, tmp_path: Path) -> Path:
    """A copy of a gateway's folder."""
    return Path(shutil.copytree(made.folder(NAME), tmp_path / "bus"))


def test_a_sound_folder_says_whose_it_is_and_how_long_it_is_good(folder: Path) -> None:
    identity = tls.load(folder, MADE)
    assert (identity.common_name, identity.name) == (NAME, "attic")
    assert identity.expires == MADE + timedelta(days=100)


def _spoil_key(folder: Path) -> None:
    text = (folder / tls.PRIVATE_KEY).read_text()
    (folder / tls.PRIVATE_KEY).write_text(text[:80] + "!" + text[81:])


FAULTS: dict[str, tuple[Callable[[Path, SecuredFleet], object], str]] = {
    "no folder": (lambda folder, _: shutil.rmtree(folder), "is not there"),
    "a file": (lambda folder, _: (shutil.rmtree(folder), folder.touch()), "is no folder"),
    "no key": (lambda folder, _: (folder / tls.PRIVATE_KEY).unlink(), "has no file private.key"),
    "no certificate": (lambda folder, _: (folder / tls.CERTIFICATE).unlink(), "has no file certificate.pem"),
    "no authority": (lambda folder, _: (folder / tls.AUTHORITY).unlink(), "has no file ca.pem"),
    "no configuration": (lambda folder, _: (folder / tls.CONFIG).unlink(), "has no file zenoh.json5"),
    "a key that the group may read": (
        lambda folder, _: (folder / tls.PRIVATE_KEY).chmod(0o640),
        r"others than its owner may read .*private.key \(mode 0640\): chmod 600",
    ),
    "a spoiled key": (lambda folder, _: _spoil_key(folder), "holds no private key that can be read"),
    "another's key": (
        lambda folder, made: shutil.copy(made.folder("operator.anna.g1") / tls.PRIVATE_KEY, folder),
        "does not belong to certificate.pem beside it",
    ),
    "a spoiled certificate": (
        lambda folder, _: (folder / tls.CERTIFICATE).write_text("none"),
        "certificate.pem holds no certificate",
    ),
    "another's authority": (
        lambda folder, _: shutil.copy(_elsewhere(folder).folder(NAME) / tls.AUTHORITY, folder),
        "was not issued by the authority in ca.pem",
    ),
}


def _elsewhere(folder: Path) -> SecuredFleet:
    (folder.parent / "elsewhere").mkdir()
    return rendered(folder.parent / "elsewhere", now=MADE)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_folder_that_can_not_be_used_is_told_by_file_and_what_to_do(
    fault: str, folder: Path, made: SecuredFleet
) -> None:
    spoil, told = FAULTS[fault]
    key = (folder / tls.PRIVATE_KEY).read_text().splitlines()[1]
    spoil(folder, made)
    with pytest.raises(TlsError, match=told) as refusal:
        tls.load(folder, MADE)
    assert key[:20] not in str(refusal.value)


def test_an_expired_certificate_is_told_with_the_day_and_the_way_to_a_new_one(folder: Path) -> None:
    with pytest.raises(
        TlsError, match=r"gateway.attic.g1 expired on 2026-06-09: run noctule-deploy renew gateway.attic,"
    ):
        tls.load(folder, MADE + timedelta(days=100, seconds=1))


def test_a_certificate_that_is_not_valid_yet_is_a_matter_of_the_clock(folder: Path) -> None:
    with pytest.raises(
        TlsError, match=r"valid from 2026-03-01 11:00 UTC, and this host's clock says 2026-02-01 .*clock"
    ):
        tls.load(folder, MADE - timedelta(days=28))


@pytest.mark.parametrize(("days_left", "told"), [(30.01, ""), (29.9, "expires on 2026-06-09"), (-1, "expired on")])
def test_expiry_is_an_alarm_from_thirty_days_before(folder: Path, days_left: float, told: str) -> None:
    identity = tls.load(folder, MADE)
    alarm = identity.expiry_alarm(identity.expires - timedelta(days=days_left))
    assert bool(alarm) == bool(told)
    assert told in alarm


def test_the_log_says_each_day_that_a_certificate_expires_soon(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    identity = tls.load(folder, MADE)
    watch, told = ExpiryWatch(identity), list[int]()
    for hour in range(24 * 100):
        watch.look(MADE + timedelta(hours=hour))
        told.append(len(caplog.messages))
    assert told[24 * 70 - 1] == 0  # it is valid for 100 days
    assert told[24 * 70 + 1] == 1
    assert told[-1] == 31  # MADE is at noon
    assert ExpiryWatch(None).look(MADE) == ""


def test_the_folder_that_the_environment_names_is_used_where_none_is_given(
    folder: Path, made: SecuredFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(tls.FOLDER_VARIABLE, raising=False)
    assert tls.chosen(None) is None
    monkeypatch.setenv(tls.FOLDER_VARIABLE, str(folder))
    chosen, given = tls.chosen(None, MADE), tls.chosen(made.folder("operator.anna.g1"), MADE)
    assert chosen and given and (chosen.common_name, given.common_name) == (NAME, "operator.anna.g1")
