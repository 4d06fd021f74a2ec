"""Which mapper has which site: when one goes, only its sites move; all are kept about equally busy."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from noctule_mapper.sharing.rendezvous import owner_of

NAMES = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,8}", fullmatch=True)
SITES = [f"site-{number}" for number in range(3000)]


@given(NAMES, st.sets(NAMES, min_size=2), st.data())
def test_a_member_that_goes_gives_away_its_own_sites_and_no_other_moves(site, members, data):
    gone = data.draw(st.sampled_from(sorted(members)))
    before, after = owner_of(site, members), owner_of(site, members - {gone})
    assert before in members
    assert after == before or (before == gone and after in members)


def test_sites_are_spread_over_the_members_and_a_gone_ones_over_all_the_others():
    members = {"north", "south", "east"}
    owners = {site: owner_of(site, members) for site in SITES}
    # Binomial with p = 1/3 over 3000: standard deviation 26; five of them.
    assert all(870 < count < 1130 for count in Counter(owners.values()).values())
    heirs = Counter(owner_of(site, members - {"east"}) for site, owner in owners.items() if owner == "east")
    # Half of about 1000: standard deviation 16.
    assert set(heirs) == {"north", "south"}
    assert abs(heirs["north"] - heirs["south"]) < 160


def test_without_a_member_a_site_has_no_owner():
    assert owner_of("hall", ()) is None
