"""A long log leaves the same window whether each sweep of it enters or only those that last."""

import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from mapper.stored_sweeps import cursor, sweep

from noctule.messages_pb2 import Sweep
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.readings.faulty import suspects
from noctule_mapper.window import lasting

PLACES_M = (0.0, 0.03, 0.04, 0.2, 1.0)  # the first three are near one another: 5 cm make a place


def drawn_log(rng: np.random.Generator) -> list[Sweep]:
    """Stays of all lengths, some of them at poses that waver; now and then sweeps turn out suspect, or clocks jump."""
    log: list[Sweep] = []
    while len(log) < 120:
        x_m, wavers = rng.choice(PLACES_M), rng.random() < 0.2
        for _ in range(rng.choice([1, 2, 5, 12, 40])):
            number = len(log) + 1
            late_s = -40.0 if rng.random() < 0.02 else 0.0
            log.append(sweep(number, start_s=number + late_s, x_m=x_m + wavers * rng.normal(0, 0.01)))
            log[-1].clock_epoch = "one" if number < 60 else "two"
            if rng.random() < 0.03:
                log[-1].suspect_before = int(rng.integers(1, 12))
    return log


def window_after(
    path: Path, batches: Sequence[Sequence[Sweep]], window: Window, entering: Callable[[Sequence[Sweep]], list[Sweep]]
) -> list[tuple[object, ...]]:
    """The rows of a store in which these batches were committed, as they came, without the time of their coming."""
    store = SweepStore(path, window)
    for batch in batches:
        store.commit(entering(batch), [cursor(batch[-1].log_sequence)], suspects(batch))
    store.close()
    with closing(sqlite3.connect(path)) as database:
        return database.execute(
            "SELECT unit, log_id, log_sequence, visit, place_x_m, place_heading_rad, record FROM sweep ORDER BY rowid"
        ).fetchall()


@pytest.mark.parametrize("first_seed", range(0, 60, 20))
def test_the_window_is_the_same_as_if_each_sweep_had_entered(tmp_path: Path, first_seed: int) -> None:
    entered = [0, 0]
    for seed in range(first_seed, first_seed + 20):
        rng = np.random.default_rng(seed)
        log, window = drawn_log(rng), Window(sweeps_per_place=int(rng.integers(1, 9)), max_sweeps=25, max_age_s=90.0)
        unusable = set(rng.choice(len(log), len(log) // 8) + 1)
        cuts = np.unique(np.append(rng.integers(1, len(log), rng.integers(0, 12)), len(log)))
        batches = [log[begin:end] for begin, end in zip([0, *cuts[:-1]], cuts, strict=True)]
        if again := rng.random() < 0.5:  # the log is read again from its tail, as after the store was rebuilt
            batches += batches[rng.integers(0, len(batches)) :]

        def each(batch: Sequence[Sweep], unusable: set[int] = unusable) -> list[Sweep]:
            found = suspects(batch)
            sound = [one for one in batch if one.log_sequence not in unusable and not any(s.has(one) for s in found)]
            entered[0] += len(sound)
            return sound

        def those_that_last(
            batch: Sequence[Sweep], unusable: set[int] = unusable, most: int = window.sweeps_per_place
        ) -> list[Sweep]:
            found = suspects(batch)

            def is_usable(one: Sweep) -> bool:
                return one.log_sequence not in unusable and not any(s.has(one) for s in found)

            kept = lasting(batch, is_usable, most)
            entered[1] += len(kept)
            return kept

        wanted = window_after(tmp_path / f"{seed}-each.sqlite3", batches, window, each)
        found = window_after(tmp_path / f"{seed}-lasting.sqlite3", batches, window, those_that_last)
        if again:  # a sweep that enters for the second time may begin a visit of another number
            wanted, found = [sorted(row[2] for row in rows) for rows in (wanted, found)]
        assert found == wanted, seed
        assert wanted
    assert entered[1] < 0.8 * entered[0]


def test_of_a_unit_that_stands_still_few_sweeps_are_looked_at() -> None:
    log = [sweep(number, x_m=1.0) for number in range(1, 501)]
    asked = list[int]()

    def is_usable(one: Sweep) -> bool:
        asked.append(one.log_sequence)
        return True

    kept = [one.log_sequence for one in lasting(log, is_usable, 8)]
    assert kept == [1, *range(493, 501)]
    assert sorted(asked) == kept
