"""Things that are drawn as one, without Rerun's SDK: each entry costs a relay two kilobytes, whatever is in it."""

from typing import Any, Protocol


class Drawn(Protocol):
    """As rerun.AsComponents."""

    def as_component_batches(self) -> list[Any]:
        """Its components."""
        ...


class Together:
    """Archetypes of one entity that are logged as one."""

    def __init__(self, *archetypes: Drawn) -> None:
        self._archetypes = archetypes

    def as_component_batches(self) -> list[Any]:
        """Those of all archetypes."""
        return [batch for archetype in self._archetypes for batch in archetype.as_component_batches()]
