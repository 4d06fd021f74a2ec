"""What is drawn: entity paths and what to log there."""

from collections.abc import Iterable

import rerun as rr

Entries = Iterable[tuple[str, rr.AsComponents | Iterable[rr.DescribedComponentBatch]]]


def together(*archetypes: rr.AsComponents) -> list[rr.DescribedComponentBatch]:
    """Archetypes of one entity as one: each that is logged costs the relay two kilobytes, whatever is in it."""
    return [batch for archetype in archetypes for batch in archetype.as_component_batches()]
