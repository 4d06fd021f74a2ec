"""The order of an update campaign: groups, tries, halt, and what the same command finds when it is begun again."""

from noctule.campaign.campaign import Campaign, Candidate, Outcome, Rules

RULES = Rules(first=2, group=3, max_failed_share=0.34, retries=1)


def units(count: int, firmware: str = "0.2.0") -> list[Candidate]:
    return [Candidate(f"u{number}", firmware) for number in range(1, count + 1)]


def run(campaign: Campaign, failing: dict[str, int]) -> list[list[str]]:
    """Go through ``campaign``; a unit fails as many times as ``failing`` says. What was updated at the same time."""
    left, groups = dict(failing), []
    while group := campaign.next_units():
        groups.append(group)
        for unit in group:
            left[unit] = left.get(unit, 0) - 1
            campaign.note(unit, "the line was cut" if left[unit] >= 0 else "", "0.2.0 -> 0.9.0")
    return groups


def outcomes(campaign: Campaign) -> dict[str, Outcome]:
    return {each.unit: each.outcome for each in campaign.results()}


def test_a_few_units_come_first_and_the_others_in_groups() -> None:
    campaign = Campaign(units(7), "0.9.0", RULES)
    assert run(campaign, {}) == [["u1", "u2"], ["u3", "u4", "u5"], ["u6", "u7"]]
    assert set(outcomes(campaign).values()) == {Outcome.UPDATED}
    assert [each.group for each in campaign.results()] == [1, 1, 2, 2, 2, 3, 3]


def test_only_those_of_a_group_that_failed_are_tried_again() -> None:
    campaign = Campaign(units(5), "0.9.0", RULES)
    assert run(campaign, {"u4": 1}) == [["u1", "u2"], ["u3", "u4", "u5"], ["u4"]]
    assert (campaign.halted, outcomes(campaign)["u4"]) == ("", Outcome.UPDATED)
    assert {each.unit: each.tries for each in campaign.results()} == {"u1": 1, "u2": 1, "u3": 1, "u4": 2, "u5": 1}


def test_a_group_of_which_more_than_the_share_fails_is_the_last_and_no_other_unit_is_touched() -> None:
    campaign = Campaign(units(7), "0.9.0", RULES)
    assert run(campaign, {"u2": 9}) == [["u1", "u2"], ["u2"]]
    assert campaign.halted.startswith("1 of the 2 units of group 1 failed, more than 34%")
    assert outcomes(campaign) == {
        "u1": Outcome.UPDATED,
        "u2": Outcome.FAILED,
        **{f"u{number}": Outcome.NOT_TRIED for number in range(3, 8)},
    }
    assert campaign.results()[1].reason == "the line was cut"
    assert campaign.next_units() == []


def test_a_share_that_is_just_reached_does_not_halt() -> None:
    campaign = Campaign(units(8), "0.9.0", RULES)
    assert len(run(campaign, {"u3": 9})) == 4  # one of three, and it is tried twice
    assert not campaign.halted
    assert outcomes(campaign)["u3"] is Outcome.FAILED


def test_a_campaign_begun_again_passes_over_those_that_have_the_version_and_takes_no_place_for_them() -> None:
    before = [*units(4, "0.9.0"), Candidate("u5", "0.2.0"), Candidate("u6", ""), Candidate("u7", "0.2.0")]
    campaign = Campaign(before, "0.9.0", RULES)
    assert run(campaign, {}) == [["u5", "u6"], ["u7"]]
    assert [each.unit for each in campaign.results() if each.outcome is Outcome.CURRENT] == ["u1", "u2", "u3", "u4"]
    assert all(each.runs_the_image for each in campaign.results())


def test_force_updates_those_that_have_the_version_too() -> None:
    campaign = Campaign(units(2, "0.9.0"), "0.9.0", Rules(force=True))
    assert run(campaign, {}) == [["u1", "u2"]]


def test_a_unit_that_is_away_is_neither_tried_nor_counted_for_a_halt() -> None:
    campaign = Campaign([Candidate("u1", "0.2.0", away="no gateway serves it"), Candidate("u2", "0.2.0")], "1", RULES)
    assert run(campaign, {}) == [["u2"]]
    away = campaign.results()[0]
    assert (away.outcome, away.reason, away.runs_the_image) == (Outcome.AWAY, "no gateway serves it", False)
