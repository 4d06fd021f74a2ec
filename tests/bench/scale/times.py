"""What the gateways and the sites' mappers have noted of each sweep: see gateway.py and timed_share.py."""

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Span = tuple[float, float]  # UTC, seconds


@dataclass(frozen=True)
class Times:
    """Sweeps by process: when they were handed over and stored, (n,) each; and the same to the contour, (m,)."""

    stored_s: np.ndarray
    stored_start_s: np.ndarray
    logged_s: np.ndarray  # (n,): when the gateway had each stored sweep in its log; NaN where it has noted nothing
    shown_s: np.ndarray
    shown_start_s: np.ndarray
    stored_by: dict[str, Counter[tuple[str, int]]]  # file to (SITE/UNIT, log_sequence)
    first_stored_s: dict[str, float]  # file to when its process stored its first sweep
    first_contour_s: dict[str, float]  # the same, published a contour

    def to_store_ms(self, span: Span) -> np.ndarray:
        """From the last byte to the store, of sweeps handed over within ``span``."""
        return _within(self.stored_s, self.stored_start_s, span)

    def to_log_ms(self, span: Span) -> np.ndarray:
        """The gateway's share of it: from the last byte to its log."""
        return _within(self.logged_s, self.stored_start_s, span)

    def log_to_store_ms(self, span: Span) -> np.ndarray:
        """The rest: from the log over the bus into the store."""
        return self.to_store_ms(span) - self.to_log_ms(span)

    def to_contour_ms(self, span: Span) -> np.ndarray:
        """From the last byte to a published contour that rests on the sweep."""
        return _within(self.shown_s, self.shown_start_s, span)

    def sequences(self, moved: Collection[str] = (), after_s: float = 0.0) -> dict[str, set[int]]:
        """SITE/UNIT to what a mapper has stored; of sites that have ``moved``, a process that began after ``after_s``
        (UTC): what a killed mapper had is its heir's to read again.
        """
        found: defaultdict[str, set[int]] = defaultdict(set)
        for file, counted in self.stored_by.items():
            if _site(file) not in moved or self._began_s(file) > after_s:
                for unit, sequence in counted:
                    found[unit].add(sequence)
        return found

    def stored_again_s(self, sites: Collection[str], after_s: float) -> dict[str, float]:
        """Of ``sites``, when a process that began after ``after_s`` (UTC) stored its first sweep; those that have."""
        return self._by_new_process(self.first_stored_s, sites, after_s)

    def published_again_s(self, sites: Collection[str], after_s: float) -> dict[str, float]:
        """The same, published a contour: the one that was left to it, or its own."""
        return self._by_new_process(self.first_contour_s, sites, after_s)

    def _by_new_process(self, first_s: dict[str, float], sites: Collection[str], after_s: float) -> dict[str, float]:
        found = dict[str, float]()
        for file, at_s in first_s.items():
            site = _site(file)
            if site in sites and self._began_s(file) > after_s:
                found[site] = min(at_s, found.get(site, np.inf))
        return found

    def _began_s(self, file: str) -> float:
        """When the process of ``file`` first stored or published (UTC)."""
        return min(first_s.get(file, np.inf) for first_s in (self.first_stored_s, self.first_contour_s))

    def doubled(self) -> int:
        """Sweeps that one process has stored more than once."""
        return sum(count - 1 for counted in self.stored_by.values() for count in counted.values())


def read(folder: Path) -> Times:
    """All that has been noted so far."""
    stored, shown, by_file, first_s, contour_s = [], [], {}, dict[str, float](), dict[str, float]()
    sweeps, logged = list[tuple[str, int]](), dict[tuple[str, int], float]()
    for file in folder.iterdir():
        site = _site(file.name)
        counted = by_file[file.name] = Counter[tuple[str, int]]()
        for line in file.read_text().splitlines():
            match line.split():
                case ["s", at, unit, sequence, start]:
                    stored.append((int(at), int(start)))
                    sweeps.append((f"{site}/{unit}", int(sequence)))
                    first_s.setdefault(file.name, int(at) * 1e-9)
                    counted[f"{site}/{unit}", int(sequence)] += 1
                case ["g", at, unit, sequence]:
                    logged[f"{site}/{unit}", int(sequence)] = int(at) * 1e-9
                case ["c", at, start]:
                    shown.append((int(at), int(start)))
                case ["p", at]:
                    contour_s.setdefault(file.name, int(at) * 1e-9)
    logged_s = np.array([logged.get(sweep, np.nan) for sweep in sweeps])
    return Times(*_columns(stored), logged_s, *_columns(shown), by_file, first_s, contour_s)


def _site(file: str) -> str:
    return file.rsplit(".", 1)[0]


def _columns(pairs: Sequence[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return table[:, 0] * 1e-9, table[:, 1] * 1e-9


def _within(at_s: np.ndarray, start_s: np.ndarray, span: Span) -> np.ndarray:
    chosen = (start_s >= span[0]) & (start_s < span[1])
    return 1e3 * (at_s - start_s)[chosen]
