"""Who may do what on a bus with the rendered rules, on real routers with real certificates."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
import zenoh
from deploy.secured_fleet import SecuredFleet
from system.processes import PATIENCE_S, wait_until

from noctule import keys
from noctule.keys import SUBJECTS, Carrier

WATCHERS = {"cartographer", "anna", "screen", "alarm", "tracker"}
ALL_OF_HOUSE = WATCHERS | {"attic"}
# By subject: who may publish it in the site "house" (its unit "u1"), and who may read it. "barn", a gateway of another
# site, may do neither, but for what is the same at all sites.
ALLOWED = {
    "sweep": ({"attic"}, WATCHERS),
    "pose": ({"tracker"}, ALL_OF_HOUSE),
    "unit_status": ({"attic"}, ALL_OF_HOUSE),
    "log": ({"attic"}, WATCHERS),
    "rpc": ({"attic"}, {"anna"}),
    "alive": ({"attic"}, ALL_OF_HOUSE),
    "service_status": ({"alarm"}, ALL_OF_HOUSE),
    "offer": ({"cartographer"}, ALL_OF_HOUSE),
    "contour": ({"cartographer"}, WATCHERS),
    "features": ({"cartographer"}, WATCHERS),
    "grid": ({"cartographer"}, WATCHERS),
    "schema": ({"attic", "barn", "cartographer"}, ALL_OF_HOUSE | {"barn"}),
}
MEMBERS = {
    "attic": "gateway.attic.g1",
    "barn": "gateway.barn.g1",
    "cartographer": "mapper.cartographer.g1",
    "anna": "operator.anna.g1",
    "screen": "viewer.screen.g1",
    "alarm": "service.alarm.g2",
    "tracker": "service.tracker.g1",
}


@pytest.fixture(scope="module")
def joined(secured: SecuredFleet) -> Iterator[dict[str, zenoh.Session]]:
    """Everybody on the bus, by name, half of them at each router."""
    with ExitStack() as closing:
        sessions = {
            name: closing.enter_context(secured.join(folder, secured.endpoint(number % 2)))
            for number, (name, folder) in enumerate(MEMBERS.items())
        }
        for name in ANSWERING:
            sessions[name].declare_queryable(FENCE, lambda query, name=name: query.reply(FENCE, name))
        for session in sessions.values():
            wait_until(lambda session=session: answering(session) == ANSWERING, "the routers were not linked")
        yield sessions


FENCE = keys.schema("fence")
ANSWERING = {"attic", "barn"}  # at one router each


def answering(session: zenoh.Session) -> set[str]:
    """Who answers a query: it has passed both routers by then."""
    replies = session.get(FENCE, target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE)
    return {reply.ok.payload.to_string() for reply in replies if reply.ok is not None}


def settle(*sessions: zenoh.Session) -> None:
    """Wait until what was sent to and from each session has passed the routers: a link keeps the order of messages."""
    for session in sessions:
        assert answering(session) == ANSWERING


def key_of(subject: str) -> str:
    """The concrete key that everybody tries."""
    service = "cartographer" if subject == "offer" else "alarm"  # an offer is a mapper's
    return SUBJECTS[subject].of(site="house", unit="u1", service=service, command="x", tile="x", message="x")


def key_of_all(subject: str) -> str:
    """The key by which the site's units and services are read."""
    return SUBJECTS[subject].of(site="house")


@pytest.mark.parametrize("subject", SUBJECTS)
def test_a_key_takes_only_its_publishers_and_reaches_only_its_readers(
    subject: str, joined: dict[str, zenoh.Session]
) -> None:
    publishers, readers = ALLOWED[subject]
    # What a session publishes it also reads itself, without any router.
    expected = {(publisher, reader) for publisher in publishers for reader in readers if publisher != reader}
    for seen in _seen(subject, joined, expected):
        assert {pair for pair in seen if pair[0] != pair[1]} == expected


def _seen(
    subject: str, joined: dict[str, zenoh.Session], expected: set[tuple[str, str]]
) -> Iterator[set[tuple[str, str]]]:
    """Who saw what of whom, by each way that the subject travels."""
    if SUBJECTS[subject].carrier in (Carrier.DATA, Carrier.STATE):
        yield _by_puts(subject, joined, expected)
    if SUBJECTS[subject].carrier in (Carrier.STATE, Carrier.ANSWER):
        yield _by_queries(subject, joined)
    if SUBJECTS[subject].carrier is Carrier.TOKEN:
        yield _by_tokens(subject, joined)


def _by_puts(subject: str, joined: dict[str, zenoh.Session], expected: set[tuple[str, str]]) -> set[tuple[str, str]]:
    seen: set[tuple[str, str]] = set()
    with ExitStack() as ending:
        for reader, session in joined.items():

            def note(sample: zenoh.Sample, reader: str = reader) -> None:
                seen.add((sample.payload.to_string(), reader))

            expression = key_of_all(subject)
            ending.callback(session.declare_subscriber(expression, note).undeclare)
        settle(*joined.values())
        for publisher, session in joined.items():
            session.put(key_of(subject), publisher, congestion_control=zenoh.CongestionControl.BLOCK)
        settle(*joined.values())
        settle(*joined.values())  # and what the routers have passed on has arrived
        wait_until(lambda: expected <= seen, "not all that is allowed has arrived")
    return seen


def _by_queries(subject: str, joined: dict[str, zenoh.Session]) -> set[tuple[str, str]]:
    seen: set[tuple[str, str]] = set()
    for publisher, session in joined.items():
        key = key_of(subject)
        queryable = session.declare_queryable(
            key, lambda query, publisher=publisher: query.reply(query.key_expr, publisher)
        )
        settle(session, *joined.values())
        for reader, asking in joined.items():
            replies = asking.get(key, timeout=PATIENCE_S, consolidation=zenoh.ConsolidationMode.NONE)
            seen |= {(reply.ok.payload.to_string(), reader) for reply in replies if reply.ok is not None}
        queryable.undeclare()
    return seen


def _by_tokens(subject: str, joined: dict[str, zenoh.Session]) -> set[tuple[str, str]]:
    seen: set[tuple[str, str]] = set()
    for publisher, session in joined.items():
        token = session.liveliness().declare_token(key_of(subject))
        settle(session, *joined.values())
        for reader, asking in joined.items():
            if any(reply.ok for reply in asking.liveliness().get(key_of_all(subject))):
                seen.add((publisher, reader))
        token.undeclare()
        settle(session, *joined.values())
    return seen
