"""Who maps a site: rendezvous hashing (Thaler and Ravishankar, 1998, "highest random weight").

Every member computes the same owner from the same members, and asks nobody. When a member goes, only its sites move,
and they spread over all the others; when one comes, it takes its share and nothing else moves.
"""

from collections.abc import Iterable
from hashlib import blake2b


def owner_of(site: str, members: Iterable[str]) -> str | None:
    """The member that maps ``site``; None where there is no member."""
    return max(members, key=lambda member: _weight(site, member), default=None)


def _weight(site: str, member: str) -> bytes:
    return blake2b(f"{site}/{member}".encode(), digest_size=8).digest()  # no name has a slash
