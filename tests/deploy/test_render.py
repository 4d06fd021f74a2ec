"""Rendering: authority, keys, certificates and configurations; renewal, revocation, and the check of it all."""

import json
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from deploy.secured_fleet import SecuredFleet, rendered
from typer.testing import CliRunner

from noctule import operators, tls
from noctule_deploy import check, cli, fleet_file, render
from noctule_deploy.check import Severity
from noctule_deploy.errors import RenderError

NOW = datetime(2026, 3, 1, tzinfo=UTC)


@pytest.fixture
def made(tmp_path: Path) -> SecuredFleet:
    """A fleet rendered at NOW."""
    return rendered(tmp_path, now=NOW)


def contents(made: SecuredFleet) -> dict[str, tuple[bytes, int]]:
    """Every file with its bytes and the time at which it was written."""
    return {
        str(path): (path.read_bytes(), path.stat().st_mtime_ns)
        for folder in (made.place.out, made.place.ca)
        for path in folder.rglob("*")
        if path.is_file()
    }


def admitted(made: SecuredFleet, subject: str) -> list[str]:
    """The certificates of a name that the first router's rules know."""
    config = json.loads((made.folder("router.one.g1") / tls.CONFIG).read_text())
    (names,) = [each["cert_common_names"] for each in config["access_control"]["subjects"] if each["id"] == subject]
    return names


def findings(made: SecuredFleet, now: datetime = NOW) -> list[check.Finding]:
    return check.check(fleet_file.load(made.file), made.place, now)


def test_rendering_twice_changes_nothing(made: SecuredFleet) -> None:
    before = contents(made)
    assert render.render(fleet_file.load(made.file), made.place, NOW + timedelta(days=1)) == []
    assert contents(made) == before


def test_keys_are_only_their_owners(made: SecuredFleet) -> None:
    keys = [*made.place.out.rglob("*.key"), *made.place.ca.rglob("*.key")]
    assert len(keys) == 10  # nine names and the authority
    assert {stat.S_IMODE(key.stat().st_mode) for key in keys} == {0o600}
    assert not list(made.place.out.rglob("ca.key"))  # kept apart


def test_a_certificate_is_for_servers_and_clients_of_its_names(made: SecuredFleet) -> None:
    certificate = x509.load_pem_x509_certificate((made.folder("router.one.g1") / tls.CERTIFICATE).read_bytes())
    key = certificate.public_key()
    assert isinstance(key, ec.EllipticCurvePublicKey) and key.curve.name == "secp256r1"
    usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert set(usage) == {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH}
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert [str(name.value) for name in names] == ["router.one.g1", "127.0.0.1"]
    assert certificate.not_valid_after_utc == NOW + timedelta(days=730)


def test_a_router_has_no_scouting_and_denies_what_no_rule_allows(made: SecuredFleet) -> None:
    config = json.loads((made.folder("router.two.g1") / tls.CONFIG).read_text())
    assert config["scouting"] == {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
    assert (config["access_control"]["enabled"], config["access_control"]["default_permission"]) == (True, "deny")
    assert config["transport"]["link"]["tls"]["enable_mtls"] is True
    assert config["connect"]["endpoints"] == [made.endpoint(0)]  # one link between two routers
    assert config["listen"]["endpoints"] == [f"tls/127.0.0.1:{made.ports[1]}"]


def test_a_name_that_joins_the_fleet_gets_a_folder_and_stands_in_the_routers_rules(made: SecuredFleet) -> None:
    before = contents(made)
    made.file.write_text(made.file.read_text() + '[[viewer]]\nname = "door"\nsites = ["house"]\n')
    touched = render.render(fleet_file.load(made.file), made.place, NOW)
    assert {path.name for path in touched} == {"router.one.g1", "router.two.g1", "viewer.door.g1"}
    assert admitted(made, "viewer.door") == ["viewer.door.g1"]
    after = contents(made)
    assert all(after[path] == content for path, content in before.items() if path.endswith((".key", ".pem")))


def test_a_renewal_admits_the_last_two_generations_and_a_revocation_only_the_new_one(made: SecuredFleet) -> None:
    members = fleet_file.load(made.file)
    old_key = (made.folder("gateway.attic.g1") / tls.PRIVATE_KEY).read_bytes()
    render.renew(members, made.place, "gateway.attic", NOW)
    assert admitted(made, "gateway.attic") == ["gateway.attic.g1", "gateway.attic.g2"]
    render.renew(members, made.place, "gateway.attic", NOW)
    assert admitted(made, "gateway.attic") == ["gateway.attic.g2", "gateway.attic.g3"]
    render.revoke(members, made.place, "gateway.attic", NOW)
    assert admitted(made, "gateway.attic") == ["gateway.attic.g4"]
    assert (made.folder("gateway.attic.g1") / tls.PRIVATE_KEY).read_bytes() == old_key
    assert findings(made) == []


def test_a_name_that_leaves_the_fleet_and_comes_back_is_not_admitted_with_its_old_key(made: SecuredFleet) -> None:
    whole = made.file.read_text()
    without = whole.replace('[[viewer]]\nname = "screen"\nsites = ["house"]\n', "")
    assert without != whole
    for text in (without, without, whole):
        made.file.write_text(text)
        render.render(fleet_file.load(made.file), made.place, NOW)
    assert admitted(made, "viewer.screen") == ["viewer.screen.g2"]


def test_a_router_that_moves_gets_a_new_certificate_for_its_old_key(made: SecuredFleet) -> None:
    folder = made.folder("router.two.g1")
    key, certificate = ((folder / name).read_bytes() for name in (tls.PRIVATE_KEY, tls.CERTIFICATE))
    made.file.write_text(made.file.read_text().replace('address = "localhost"', 'address = "router-2.example.net"'))
    render.render(fleet_file.load(made.file), made.place, NOW)
    assert (folder / tls.PRIVATE_KEY).read_bytes() == key
    assert (folder / tls.CERTIFICATE).read_bytes() != certificate


def test_a_missing_authority_is_never_replaced_by_another(made: SecuredFleet) -> None:
    made.place.ca.rename(made.place.ca.with_name("safe"))
    with pytest.raises(RenderError, match=r"has no authority, .* name its folder \(--ca\)"):
        render.render(fleet_file.load(made.file), made.place, NOW)


def test_what_was_revoked_is_not_admitted_again_because_the_generations_are_lost(made: SecuredFleet) -> None:
    (made.place.out / "generations.json").unlink()
    with pytest.raises(RenderError, match=r"generations.json is gone: bring it back from your backup"):
        render.render(fleet_file.load(made.file), made.place, NOW)


def test_a_name_that_is_none_of_the_fleet_can_not_be_revoked(made: SecuredFleet) -> None:
    with pytest.raises(RenderError, match=r"'gateway.atic' .* names are router.one, .*gateway.attic"):
        render.revoke(fleet_file.load(made.file), made.place, "gateway.atic", NOW)


def test_the_check_names_a_list_of_operators_that_is_not_the_newest(made: SecuredFleet) -> None:
    path = made.folder("gateway.attic.g1") / operators.FILE
    before = path.read_bytes()
    render.revoke(fleet_file.load(made.file), made.place, "operator.anna", NOW)
    assert findings(made) == []
    path.write_bytes(before)
    (found,) = findings(made)
    assert str(path) in found.text and "does not fit the fleet file" in found.text
    assert not (made.folder("mapper.cartographer.g1") / operators.FILE).exists()


def test_the_check_of_a_fleet_that_was_never_rendered_says_so_in_one_line(made: SecuredFleet, tmp_path: Path) -> None:
    elsewhere = render.Place(tmp_path / "elsewhere", made.place.ca)
    (finding,) = check.check(fleet_file.load(made.file), elsewhere, NOW)
    assert finding.text == f"nothing is rendered in {elsewhere.out} yet: run noctule-deploy render"
    assert finding.severity is check.Severity.WRONG


def test_a_sound_rendering_has_no_findings(made: SecuredFleet) -> None:
    assert findings(made) == []


def test_the_check_names_what_expires_within_thirty_days(made: SecuredFleet) -> None:
    soon = findings(made, NOW + timedelta(days=701))
    assert len(soon) == 9
    assert {each.severity for each in soon} == {Severity.EXPIRES}
    assert "gateway.attic.g1 expires on 2028-02-29: run noctule-deploy renew gateway.attic" in soon[2].text


def test_the_check_names_expired_certificates_and_keys_that_others_may_read(made: SecuredFleet) -> None:
    (made.place.ca / "ca.key").chmod(0o644)
    (made.folder("viewer.screen.g1") / tls.PRIVATE_KEY).chmod(0o604)
    texts = [each.text for each in findings(made) if each.severity is Severity.WRONG]
    assert len(texts) == 2 and all("chmod 600" in text for text in texts)
    assert all(
        "expired on" in each.text for each in findings(made, NOW + timedelta(days=731)) if "chmod" not in each.text
    )


def test_the_check_sees_a_fleet_file_that_was_changed_and_not_rendered(made: SecuredFleet) -> None:
    made.file.write_text(made.file.read_text().replace('units = ["u1", "u2"]', 'units = ["u1", "u2", "u3"]'))
    texts = [each.text for each in findings(made)]
    assert len(texts) == 2 and all("does not fit the fleet file and its generations" in text for text in texts)


def test_the_check_sees_rules_that_still_admit_a_revoked_generation(made: SecuredFleet) -> None:
    stale = (made.folder("router.one.g1") / tls.CONFIG).read_bytes()
    render.revoke(fleet_file.load(made.file), made.place, "viewer.screen", NOW)
    (made.folder("router.one.g1") / tls.CONFIG).write_bytes(stale)
    (finding,) = findings(made)
    assert "router.one.g1" in finding.text and finding.severity is Severity.WRONG


def test_the_commands_exit_status_says_how_it_stands(tmp_path: Path) -> None:
    made = rendered(tmp_path, "valid_days = 20")
    options = [str(made.file), "--out", str(made.place.out), "--ca", str(made.place.ca)]
    run = CliRunner().invoke
    assert run(cli.app, ["check", *options]).exit_code == 3
    made.file.write_text(made.file.read_text().replace("valid_days = 20", "valid_days = 700"))
    for subject in fleet_file.load(made.file).subjects():
        assert run(cli.app, ["renew", subject, *options]).exit_code == 0
    assert run(cli.app, ["check", *options]).exit_code == 0
    (made.place.ca / "ca.key").chmod(0o640)
    assert run(cli.app, ["check", *options]).exit_code == 1
