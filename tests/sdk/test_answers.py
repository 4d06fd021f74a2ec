"""That no answer came in time is never taken for the answer that nobody is there."""

import os
import signal
from contextlib import closing

import pytest
from sdk.followed import LoggedUnit, RouterProcess
from system.processes import PATIENCE_S, wait_until

from noctule import Client, bus, client, keys
from noctule.cli.joining import what_there_is
from noctule.cli.site_table import show_site
from noctule.errors import BusError, NotServedError, SilenceError
from noctule.messages_pb2 import CommandReply, CommandRequest


def test_which_units_are_served_is_not_known_while_the_router_does_not_answer(endpoint, monkeypatch):
    """A router that had not answered in time made ``noctule units`` blame the gateway."""
    router = RouterProcess(endpoint)
    try:
        with closing(bus.open_session([endpoint])) as session, Client("room", [endpoint]) as asking:
            unit = LoggedUnit(session, "u1")
            wait_until(lambda: asking.units() == {"u1"}, "it is not seen")
            os.kill(router.pid, signal.SIGSTOP)
            with monkeypatch.context() as hasty:
                hasty.setattr(client, "QUERY_TIMEOUT_S", 0.2)
                with pytest.raises(
                    SilenceError, match="which units of site 'room' are served is not known: the router"
                ):
                    asking.units()
            with pytest.raises(BusError, match="Timeout") as raised:
                asking.command("u2", "stop", CommandRequest(), 0.2)
            assert not isinstance(raised.value, NotServedError)
            os.kill(router.pid, signal.SIGCONT)
            assert asking.units() == {"u1"}
            unit.end()
    finally:
        router.stop()


class Rejoining(Client):
    """A client whose first look at the units finds none, because their gateways are not back on a restarted router.
    ``rejoin`` is called with what each look finds.
    """

    def __init__(self, session, rejoin):
        super().__init__("room", session=session)
        self._rejoin = rejoin

    def units(self):
        found = super().units()
        self._rejoin(found)
        return found


def test_a_command_waits_for_a_gateway_that_rejoins_and_is_given_to_it_once(open_session, monkeypatch):
    session, given, declared = open_session(), [], []

    def answer(query):
        given.append(CommandRequest.FromString(query.payload.to_bytes()).request_id)
        query.reply(query.key_expr, CommandReply(done=True).SerializeToString())

    def rejoin(_found):
        if not declared:
            declared.append(session.declare_queryable(keys.rpc("room", "u1", keys.ANY), answer))
            declared.append(session.liveliness().declare_token(keys.alive("room", "u1")))

    monkeypatch.setattr(client, "REJOIN_S", PATIENCE_S)
    with Rejoining(open_session(), rejoin) as asking:
        assert asking.command("u1", "stop", CommandRequest(request_id="r"), 5.0).done
        assert given == ["r"]
        with pytest.raises(NotServedError, match="no gateway serves unit 'u2'"):  # at once: others are served
            asking.command("u2", "stop", CommandRequest(), 5.0)


def test_a_command_waits_for_its_own_unit_when_others_are_back_before_it(open_session, monkeypatch):
    """A unit of another gateway, which was back first, had the command end at once: "no gateway serves"."""
    session, declared = open_session(), {}

    def rejoin(found):
        back = "u1" if "u2" in found else "u2"
        if back not in declared:
            declared[back] = [
                session.declare_queryable(
                    keys.rpc("room", back, keys.ANY),
                    lambda query: query.reply(query.key_expr, CommandReply(done=True).SerializeToString()),
                ),
                session.liveliness().declare_token(keys.alive("room", back)),
            ]

    monkeypatch.setattr(client, "REJOIN_S", PATIENCE_S)
    with Rejoining(open_session(), rejoin) as asking:
        assert asking.command("u1", "stop", CommandRequest(request_id="r"), 5.0).done


def silent():
    raise SilenceError("which units are served is not known")


def test_what_else_there_is_never_replaces_the_error_that_it_is_said_beside(open_session, monkeypatch):
    with Client("room", session=open_session()) as asking:
        monkeypatch.setattr(asking, "units", silent)
        assert what_there_is(asking) == ""


def test_a_table_that_is_watched_stands_while_the_router_is_busy(open_session, endpoint, monkeypatch):
    """One answer that did not come in time ended ``noctule units --watch``."""
    unit, looks, units = LoggedUnit(open_session(), "u1"), [], Client.units

    def busy_once(asking):
        looks.append(asking)
        if len(looks) == 2:
            silent()
        if len(looks) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return units(asking)

    monkeypatch.setattr(Client, "units", busy_once)
    show_site("room", [endpoint], None, json=False, goes_on=True)
    assert len(looks) == 3
    unit.end()
