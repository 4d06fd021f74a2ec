"""Which generations of each name's certificate the routers admit.

Zenoh reads no revocation lists, so the generation is a part of the name, and a revoked one stands in no rule. A renewal
admits the last two, so that the old certificate serves until the new one is in place.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from noctule_deploy.errors import RenderError
from noctule_deploy.files import write_atomically

FILE = "generations.json"


@dataclass(frozen=True)
class Generations:
    """The admitted ones of a name, ``oldest`` to ``newest``; none where ``oldest`` is above ``newest``."""

    oldest: int
    newest: int

    def renewed(self) -> "Generations":
        """One more; the one before it stays admitted."""
        return Generations(max(self.oldest, self.newest), self.newest + 1)

    def revoked(self) -> "Generations":
        """One more, and only that one."""
        return Generations(self.newest + 1, self.newest + 1)

    def withdrawn(self) -> "Generations":
        """None of those that there are."""
        return Generations(self.newest + 1, self.newest)

    def admitted(self, subject: str) -> list[str]:
        """The common names that are admitted, oldest first."""
        return [common_name(subject, number) for number in range(self.oldest, self.newest + 1)]


FIRST = Generations(1, 1)


def common_name(subject: str, generation: int) -> str:
    """The common name of one certificate: ``gateway.attic.g2``."""
    return f"{subject}.g{generation}"


def load(folder: Path) -> dict[str, Generations]:
    """By subject; empty where nothing was rendered yet. Raises RenderError."""
    path = folder / FILE
    try:
        entries = json.loads(path.read_text())
        return {subject: Generations(int(each["oldest"]), int(each["newest"])) for subject, each in entries.items()}
    except FileNotFoundError as error:
        if any(folder.glob("*.g*")):
            raise RenderError(
                f"{path} is gone: bring it back from your backup, because it says which certificates are revoked"
            ) from error
        return {}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise RenderError(
            f"{path} can't be read ({error}): bring it back from your backup, it says which certificates are revoked"
        ) from error


def save(folder: Path, generations: dict[str, Generations]) -> None:
    """Write them down. Raises RenderError."""
    entries = {subject: {"oldest": each.oldest, "newest": each.newest} for subject, each in sorted(generations.items())}
    write_atomically(folder / FILE, (json.dumps(entries, indent=2) + "\n").encode())


def of_fleet(known: dict[str, Generations], subjects: Iterable[str]) -> dict[str, Generations]:
    """``known`` after the fleet has changed: a new name begins with its first, one that is gone is withdrawn.

    A name that comes back after that gets a new generation, because its old key may be anywhere.
    """
    present = set(subjects)
    result = {subject: each if subject in present else each.withdrawn() for subject, each in known.items()}
    for subject in present:
        before = result.get(subject)
        if before is None:
            result[subject] = FIRST
        elif before.oldest > before.newest:
            result[subject] = before.revoked()
    return result
