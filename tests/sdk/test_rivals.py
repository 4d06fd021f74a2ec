"""A state that two programs publish is an alarm, also where both bear one name, until one of them is gone."""

from socket import gethostname

import pytest
import zenoh
from system.processes import wait_until

from noctule import keys
from noctule.bus import StatePublisher
from noctule.messages_pb2 import ServiceStatus
from noctule.rivals import GONE_AFTER_S, Rivals


class Service:
    """A mapper as far as its status goes, with a clock that stands still."""

    def __init__(self, session: zenoh.Session, name: str, role: str = "mapper") -> None:
        self.now_s = 0.0
        self._status = ServiceStatus(site="room", name=name, role=role)
        self._publisher = StatePublisher(session, keys.service_status("room", name), ServiceStatus)
        self._rivals = Rivals(
            session,
            keys.service_status("room", keys.ANY),
            ServiceStatus,
            lambda status: status.name if status.role == "mapper" else "",
            lambda: self.now_s,
        )

    def rivals(self) -> list[str]:
        self._publisher.put(self._status)
        return self._rivals.names()


@pytest.mark.parametrize("name", ["m1", "m2"])
def test_two_mappers_see_each_other_whatever_their_names_are_until_one_is_silent(sessions, name) -> None:
    first, second = Service(sessions[0], "m1"), Service(sessions[1], name)
    seen = [f"m1 on {gethostname()}"], [f"{name} on {gethostname()}"]
    wait_until(lambda: (second.rivals(), first.rivals()) == seen, "they don't see each other")
    first.now_s += GONE_AFTER_S
    assert first.rivals() == seen[1]

    def is_gone() -> bool:
        first.now_s += GONE_AFTER_S + 0.1  # what was on its way counted as heard at the last look
        return first.rivals() == []

    wait_until(is_gone, "the one that is silent still counts")


def test_neither_its_own_state_nor_that_of_another_kind_of_service_is_a_rivals(sessions) -> None:
    first, second = Service(sessions[0], "m1"), Service(sessions[1], "g1", role="gateway")
    seen = [f"m1 on {gethostname()}"]
    wait_until(lambda: (first.rivals(), second.rivals()) == ([], seen), "the mapper is not seen")
    assert first.rivals() == []


@pytest.mark.parametrize(
    ("attached", "shown"),
    [("a1", "m2"), ("a1 pi-2.lan", "m2 on pi-2.lan"), ("a1 \x1b[31m", "m2"), (f"a1 {'x' * 65}", "m2")],
)
def test_a_host_that_is_left_out_or_is_none_is_not_shown(sessions, attached, shown) -> None:
    first, key = Service(sessions[0], "m1"), keys.service_status("room", "m2")
    status = ServiceStatus(site="room", name="m2", role="mapper").SerializeToString()

    def is_seen() -> bool:
        sessions[1].put(key, status, attachment=attached)  # as an earlier version does, or a stranger
        return first.rivals() == [shown]

    wait_until(is_seen, "the mapper is not seen")
