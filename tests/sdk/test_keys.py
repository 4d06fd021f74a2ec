"""Keys are built and taken apart in one place."""

import inspect
from pathlib import Path

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from noctule import keys, messages_pb2
from noctule.errors import KeyFormatError

NAMES = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,20}", fullmatch=True)
OF_A_UNIT = st.sampled_from([keys.sweep, keys.pose, keys.unit_status, keys.log, keys.alive])


@given(NAMES, NAMES, OF_A_UNIT)
def test_a_units_key_names_its_site_and_unit_and_zenoh_takes_it(site, unit, build):
    key = build(site, unit)
    parsed = keys.parse_unit(key)
    assert (parsed.site, parsed.unit) == (site, unit)
    assert build(parsed.site, parsed.unit) == key
    assert str(zenoh.KeyExpr(key)) == key


@given(NAMES, NAMES, NAMES)
def test_a_commands_key_has_the_command_as_its_last_chunk(site, unit, command):
    assert keys.parse_unit(keys.rpc(site, unit, command)) == keys.UnitKey(site, unit, f"@rpc/{command}")


@given(NAMES, NAMES)
def test_the_key_of_a_services_status_names_its_site_and_service(site, service):
    assert keys.parse_service_status(keys.service_status(site, service)) == (site, service)
    with pytest.raises(KeyFormatError):
        keys.parse_service_status(keys.offer(site, service))


@given(st.text().filter(lambda text: not keys._NAME.fullmatch(text) and text != keys.ANY))
def test_a_name_that_does_not_fit_a_chunk_is_refused_by_what_it_names(name):
    with pytest.raises(KeyFormatError, match=r"^site "):
        keys.contour(name)
    with pytest.raises(KeyFormatError, match=r"^unit "):
        keys.sweep("room", name)


@pytest.mark.parametrize(
    "key", ["noctule/@v1/room/map/contour", "noctule/@v2/room/unit/u1/sweep", "noctule/@v1/room/unit/u1", ""]
)
def test_a_key_that_is_not_a_units_is_refused(key):
    with pytest.raises(KeyFormatError):
        keys.parse_unit(key)


@pytest.mark.parametrize("sealed", [keys.log("room", "u1"), keys.rpc("room", "u1", "home"), keys.alive("room", "u1")])
def test_a_subscription_to_everything_sees_data_but_neither_logs_nor_commands(sealed):
    everything = zenoh.KeyExpr(f"{keys.ROOT}/**")
    assert everything.intersects(zenoh.KeyExpr(keys.sweep("room", "u1")))
    assert not everything.intersects(zenoh.KeyExpr(sealed))


def test_each_subject_has_a_function_that_builds_its_key():
    for subject, described in keys.SUBJECTS.items():
        build = getattr(keys, subject)
        chunks = {name: name for name in inspect.signature(build).parameters}
        assert build(**chunks) == f"{keys.ROOT}/{described.key.format_map(chunks)}"


def test_each_subjects_message_is_one_of_the_contract():
    known = {message.full_name for message in messages_pb2.DESCRIPTOR.message_types_by_name.values()}
    told = {subject.message for subject in keys.SUBJECTS.values()}
    assert told - known == {"", "google.protobuf.FileDescriptorSet"}


def test_the_readme_lists_every_subject():
    readme = (Path(__file__).parents[2] / "sdk/README.md").read_text()
    for subject in keys.SUBJECTS.values():
        message = f"`{subject.message.rsplit('.', 1)[-1]}`" if subject.message else ""
        assert f"| `{subject.key}` | {message} | {subject.publisher} | {subject.meaning} |" in readme


@pytest.mark.parametrize("several", ["*", "**", "u$*", "@rpc"])
def test_a_commands_key_is_of_one_unit_and_one_command(several: str) -> None:
    key = keys.rpc("room", "u1", "stop")
    assert keys.parse_rpc(key) == "stop"
    for wild in (key.replace("u1", several), key.replace("stop", several), key.replace("room", several)):
        with pytest.raises(KeyFormatError):
            keys.parse_rpc(wild)


def test_others_read_a_units_or_a_services_key_by_the_same_with_any_name():
    assert keys.of_all(keys.unit_status("room", "u1")) == keys.unit_status("room", keys.ANY)
    assert keys.of_all(keys.service_status("room", "s1")) == keys.service_status("room", keys.ANY)
    assert keys.of_all(keys.contour("room")) == keys.contour("room")
