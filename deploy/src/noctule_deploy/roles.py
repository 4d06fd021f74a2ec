"""What each role may do on the bus, as access rules of Zenoh, made from the one table of keys in ``noctule.keys``.

A rule holds where a message's key is included in one of the rule's, as seen from the router: ingress is what comes from
the member, egress what goes to it. The router drops everything else and says nothing. Three traps shaped the rules:
``**`` does not match a chunk that begins with ``@``, so such keys stand one by one. A query or subscription with a
wildcard is not included in a rule of one unit. A publisher that is not told of a subscriber drops its puts itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from noctule.keys import ROOT, SUBJECTS, Carrier, Subject
from noctule_deploy.fleet import Member

INGRESS, EGRESS = "ingress", "egress"
PUTS = ("put", "delete")
ANSWERS = ("reply", "declare_queryable")
TOKENS = ("liveliness_token",)
SUBSCRIPTIONS = ("declare_subscriber",)
QUERIES = ("query",)
TOKEN_WATCHES = ("declare_liveliness_subscriber", "liveliness_query")
MESSAGES = PUTS + ANSWERS + TOKENS + SUBSCRIPTIONS + QUERIES + TOKEN_WATCHES

_EVERYTHING_PLAIN = f"{ROOT}/**"
_SUBSCRIBED = (Carrier.DATA, Carrier.STATE)
_QUERIED = (Carrier.STATE, Carrier.ANSWER)


@dataclass(frozen=True)
class Rule:
    """Allows ``messages`` of one ``flow`` on keys that are included in one of ``key_exprs``."""

    messages: tuple[str, ...]
    flow: str
    key_exprs: tuple[str, ...]


def rules_of(member: Member) -> list[Rule]:
    """All that a member may do."""
    return [rule for rule in (*_publishing(member), *_reading(member)) if rule.key_exprs]


def rules_of_routers() -> list[Rule]:
    """A router may pass on everything: each message was checked where it entered."""
    key_exprs = (_EVERYTHING_PLAIN, *(each.of() for each in SUBJECTS.values() if _is_sealed(each)))
    return [Rule(MESSAGES, flow, key_exprs) for flow in (INGRESS, EGRESS)]


def own_keys(member: Member, subject: Subject) -> list[str]:
    """The keys of a subject on which a member may publish, none where that is not its role."""
    if member.role not in subject.publishers:
        return []
    chunks = subject.chunks()
    if "unit" in chunks:
        return [subject.of(site=site, unit=unit) for site, unit in member.units]
    if "site" in chunks:
        return [subject.of(site=site, service=member.name) for site in member.sites]
    return [subject.of()]


def read_keys(member: Member, subject: Subject) -> list[str]:
    """The keys of a subject that a member may read, none where that is not its role."""
    if member.role not in subject.readers:
        return []
    return list(dict.fromkeys(subject.of(site=site) for site in member.sites))


def _publishing(member: Member) -> Iterator[Rule]:
    def own(*carriers: Carrier) -> tuple[str, ...]:
        return tuple(key for each in _of(*carriers) for key in own_keys(member, each))

    yield Rule(PUTS, INGRESS, own(*_SUBSCRIBED))
    yield Rule(ANSWERS, INGRESS, own(*_QUERIED))
    yield Rule(TOKENS, INGRESS, own(Carrier.TOKEN))
    if own(*_SUBSCRIBED):
        yield Rule(SUBSCRIPTIONS, EGRESS, (_EVERYTHING_PLAIN,))  # shows only that somebody reads
    asked = (key for each in _of(*_QUERIED) for key in _asked(member, each))
    yield Rule(QUERIES, EGRESS, tuple(dict.fromkeys(asked)))


def _asked(member: Member, subject: Subject) -> list[str]:
    """The keys by which a member may be asked: of everything plain at once, or of one unit where the unit obeys."""
    own = own_keys(member, subject)
    if not own or subject is SUBJECTS["rpc"]:
        return own
    return [subject.of()] if _is_sealed(subject) else [_EVERYTHING_PLAIN]


def _reading(member: Member) -> Iterator[Rule]:
    def read(*carriers: Carrier) -> tuple[str, ...]:
        return tuple(dict.fromkeys(key for each in _of(*carriers) for key in read_keys(member, each)))

    whole_sites = _whole_sites(member)
    yield Rule(SUBSCRIPTIONS, INGRESS, read(*_SUBSCRIBED) + whole_sites)
    yield Rule(PUTS, EGRESS, read(*_SUBSCRIBED))
    yield Rule(QUERIES, INGRESS, read(*_QUERIED) + whole_sites)
    yield Rule(ANSWERS, EGRESS, read(*_QUERIED))
    yield Rule(TOKEN_WATCHES, INGRESS, read(Carrier.TOKEN))
    yield Rule(TOKENS, EGRESS, read(Carrier.TOKEN))


def _whole_sites(member: Member) -> tuple[str, ...]:
    """``site/**`` for a member that may read all of a site but commands, logs and tokens; recorders subscribe to it."""
    if not all(member.role in subject.readers for subject in _of(*_SUBSCRIBED)):
        return ()
    return tuple(f"{ROOT}/{site}/**" for site in member.sites)


def _of(*carriers: Carrier) -> list[Subject]:
    return [subject for subject in SUBJECTS.values() if subject.carrier in carriers]


def _is_sealed(subject: Subject) -> bool:
    """Whether a chunk below the root is verbatim, so that ``**`` does not match it."""
    return any(chunk.startswith("@") for chunk in subject.key.split("/"))
