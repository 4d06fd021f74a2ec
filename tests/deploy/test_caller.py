"""Where there are certificates, commands are signed, and nobody can give one in another's name."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding
from deploy.secured_fleet import SecuredFleet, rendered
from hypothesis import given
from hypothesis import strategies as st

from noctule import caller, operators, tls
from noctule.caller import Callers, Who
from noctule.errors import CallerError, TlsError
from noctule.messages_pb2 import Caller
from noctule_deploy import authority, fleet_file, render

KEY, PAYLOAD = "noctule/@v1/house/unit/u1/@rpc/stop", b"\x0a\x04mine"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> SecuredFleet:
    return rendered(tmp_path_factory.mktemp("fleet"))


@pytest.fixture(scope="module")
def callers(made: SecuredFleet) -> Callers:
    return Callers(made.folder("gateway.attic.g1"))


def attached(made: SecuredFleet, name: str = "operator.anna.g1") -> Caller:
    return Caller.FromString(caller.attachment("abc", made.folder(name), KEY, PAYLOAD))


def test_a_signed_command_is_its_operators(made: SecuredFleet, callers: Callers) -> None:
    assert callers.who(attached(made).SerializeToString(), KEY, PAYLOAD) == Who("operator.anna.g1", signed=True)


def test_a_command_for_one_unit_is_no_command_for_another_nor_another_command(
    made: SecuredFleet, callers: Callers
) -> None:
    signed = attached(made).SerializeToString()
    for key, payload in ((KEY.replace("u1", "u2"), PAYLOAD), (KEY, b"\x0a\x04mina")):
        with pytest.raises(CallerError, match="signature does not hold"):
            callers.who(signed, key, payload)


def test_nobody_signs_with_the_certificate_of_another(made: SecuredFleet, callers: Callers) -> None:
    forged = attached(made, "viewer.screen.g1")
    forged.certificate = attached(made).certificate
    with pytest.raises(CallerError, match="signature does not hold"):
        callers.who(forged.SerializeToString(), KEY, PAYLOAD)


def test_a_certificate_of_another_fleet_or_of_no_operator_signs_nothing(
    made: SecuredFleet, callers: Callers, tmp_path: Path
) -> None:
    with pytest.raises(CallerError, match="another fleet's certificate"):
        callers.who(attached(rendered(tmp_path)).SerializeToString(), KEY, PAYLOAD)
    with pytest.raises(CallerError, match=r"signed by viewer\.screen\.g1: only operators command units"):
        callers.who(attached(made, "viewer.screen.g1").SerializeToString(), KEY, PAYLOAD)


def test_an_expired_certificate_signs_nothing(made: SecuredFleet, callers: Callers) -> None:
    issuer = authority.open_or_create(made.place.ca, datetime.now(UTC))
    key = ec.generate_private_key(ec.SECP256R1())
    began = datetime.now(UTC) - timedelta(days=3)
    old = issuer.issue("operator.anna.g1", (), key, began, timedelta(days=1))
    message = b"noctule command 1\n" + KEY.encode() + b"\n" + PAYLOAD  # as the .proto file says
    signature = key.sign(message, ec.ECDSA(hashes.SHA256()))
    said = Caller(certificate=_der(old), signature=signature)
    with pytest.raises(CallerError, match=r"operator\.anna\.g1, whose certificate has expired: renew it"):
        callers.who(said.SerializeToString(), KEY, PAYLOAD)


def test_a_command_that_says_nobody_is_refused_where_there_are_certificates(callers: Callers) -> None:
    with pytest.raises(CallerError, match="the command is not signed: give it by noctule"):
        callers.who(Caller(session="operator.anna.g1").SerializeToString(), KEY, PAYLOAD)
    with pytest.raises(CallerError, match="does not say who gives it"):
        callers.who(b"\xff", KEY, PAYLOAD)


@given(noise=st.binary(max_size=300), at=st.integers(0, 900))
def test_whatever_is_attached_names_nobody_falsely(made: SecuredFleet, callers: Callers, noise: bytes, at: int) -> None:
    sound = attached(made).SerializeToString()
    for forged in (noise, sound[:at] + noise + sound[at + len(noise) :], sound[:at]):
        try:
            assert callers.who(forged, KEY, PAYLOAD).name == "operator.anna.g1"
        except CallerError:
            continue
        assert Caller.FromString(forged).certificate == Caller.FromString(sound).certificate


def test_without_certificates_a_command_is_its_sessions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(tls.FOLDER_VARIABLE, raising=False)
    said = caller.attachment("abc", None, KEY, PAYLOAD)
    assert Callers().who(said, KEY, PAYLOAD) == Who("session abc", signed=False)
    assert Callers().who(b"", KEY, PAYLOAD) == Who("session ?", signed=False)
    assert Callers().who(b"\xff", KEY, PAYLOAD) == Who("session ?", signed=False)


def _der(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(Encoding.DER)


def test_a_refused_commands_record_says_who_was_claimed_to_have_given_it(made: SecuredFleet) -> None:
    forged = attached(made, "viewer.screen.g1")
    forged.certificate = attached(made).certificate
    assert caller.claimed(forged.SerializeToString()) == Who("operator.anna.g1", signed=False)
    assert caller.claimed(Caller(session="abc").SerializeToString()) == Who("session abc", signed=False)
    unreadable = Caller(certificate=b"0\x82").SerializeToString()
    assert caller.claimed(unreadable) == Who("a certificate that can't be read", signed=False)
    assert caller.claimed(b"\xff") == Who("session ?", signed=False)


@pytest.fixture
def fresh(tmp_path: Path) -> SecuredFleet:
    """A fleet of its own, to be changed."""
    return rendered(tmp_path)


def test_a_command_that_is_signed_with_a_revoked_operators_key_is_refused_as_soon_as_the_gateways_folder_is_new(
    fresh: SecuredFleet,
) -> None:
    gateway = Callers(fresh.folder("gateway.attic.g1"))
    members, now = fleet_file.load(fresh.file), datetime.now(UTC)
    old = attached(fresh).SerializeToString()
    assert gateway.who(old, KEY, PAYLOAD).name == "operator.anna.g1"
    render.renew(members, fresh.place, "operator.anna", now)
    gateway.look()
    new = attached(fresh, "operator.anna.g2").SerializeToString()
    assert [gateway.who(each, KEY, PAYLOAD).name for each in (old, new)] == ["operator.anna.g1", "operator.anna.g2"]
    render.revoke(members, fresh.place, "operator.anna", now)
    gateway.look()
    newest = attached(fresh, "operator.anna.g3").SerializeToString()
    assert gateway.who(newest, KEY, PAYLOAD) == Who("operator.anna.g3", signed=True)
    for callers in (gateway, Callers(fresh.folder("gateway.attic.g1")), Callers(fresh.folder("router.one.g1"))):
        for revoked in (old, new):
            with pytest.raises(CallerError, match=r"operator\.anna\.g[12], which was revoked or is not for this site"):
                callers.who(revoked, KEY, PAYLOAD)


def test_an_operator_of_another_site_commands_nothing_here_nor_does_one_who_has_left(fresh: SecuredFleet) -> None:
    whole = fresh.file.read_text()
    fresh.file.write_text(whole.replace('name = "anna"\nsites = ["*"]', 'name = "anna"\nsites = ["farm"]'))
    render.render(fleet_file.load(fresh.file), fresh.place, datetime.now(UTC))
    signed = attached(fresh).SerializeToString()
    barn = Callers(fresh.folder("gateway.barn.g1"))
    assert barn.who(signed, KEY, PAYLOAD).name == "operator.anna.g1"
    with pytest.raises(CallerError, match="is not for this site"):
        Callers(fresh.folder("gateway.attic.g1")).who(signed, KEY, PAYLOAD)
    fresh.file.write_text(whole.replace('[[operator]]\nname = "anna"\nsites = ["*"]\n', ""))
    render.render(fleet_file.load(fresh.file), fresh.place, datetime.now(UTC))
    barn.look()
    with pytest.raises(CallerError, match="was revoked"):
        barn.who(signed, KEY, PAYLOAD)


@pytest.mark.parametrize("spoiled", [None, "", '["operator.anna', '{"operator.anna.g1": 1}', "[1]", "\xff"])
def test_a_list_of_operators_that_can_not_be_read_leaves_the_one_before_in_force(
    fresh: SecuredFleet, spoiled: str | None
) -> None:
    gateway = Callers(fresh.folder("gateway.attic.g1"))
    old = attached(fresh).SerializeToString()
    render.revoke(fleet_file.load(fresh.file), fresh.place, "operator.anna", datetime.now(UTC))
    gateway.look()
    path = fresh.folder("gateway.attic.g1") / operators.FILE
    path.unlink() if spoiled is None else path.write_bytes(spoiled.encode("latin-1"))
    gateway.look()
    assert "the list before stays in force" in gateway.detail and "noctule-deploy render" in gateway.detail
    with pytest.raises(CallerError, match="was revoked"):
        gateway.who(old, KEY, PAYLOAD)
    if spoiled is not None:
        with pytest.raises(TlsError, match=r"operators\.json .*: run noctule-deploy render"):
            Callers(fresh.folder("gateway.attic.g1"))
    path.unlink(missing_ok=True)
    render.render(fleet_file.load(fresh.file), fresh.place, datetime.now(UTC))
    gateway.look()
    assert gateway.detail == ""


def test_a_folder_of_an_earlier_rendering_admits_every_operator_and_the_status_says_so(fresh: SecuredFleet) -> None:
    (fresh.folder("gateway.attic.g1") / operators.FILE).unlink()
    gateway = Callers(fresh.folder("gateway.attic.g1"))
    assert gateway.who(attached(fresh).SerializeToString(), KEY, PAYLOAD).signed
    assert gateway.detail.startswith("revoked operators are not refused: ")
