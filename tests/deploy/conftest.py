"""A secured bus, once for each module of tests that asks for one; and who can't have namespaces is not tested there."""

from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from deploy.secured_fleet import SecuredFleet, rendered, running_routers

from deploy import namespaces
from noctule_deploy import fleet_file, render


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecuredFleet]:
    """Two linked routers; the certificate service.alarm.g1 was revoked, gateway.attic.g1 is being renewed."""
    made = rendered(tmp_path_factory.mktemp("fleet"))
    members = fleet_file.load(made.file)
    render.revoke(members, made.place, "service.alarm", datetime.now(UTC))
    render.renew(members, made.place, "gateway.attic", datetime.now(UTC))
    with running_routers(made):
        yield made


@pytest.fixture(scope="session")
def can_have_namespaces() -> None:
    """Skips what asks for it where this machine can't make network namespaces."""
    if reason := namespaces.why_not():
        pytest.skip(reason)
