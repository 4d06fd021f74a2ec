"""What the mapper makes of units whose poses are unknown, or stated by tape measure, over many simulated rooms.

    PYTHONPATH=tests python tests/bench/poses.py unknown|taped [--rooms 50] [--seed 1] [--jobs 2]

A line for every room, as soon as it is done, and the sums at the end. Nothing is passed or failed here.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from mapper.judged_poses import Taped, Unknown, honest_bounds, taped, unknown
from scipy.stats import chi2


def main() -> None:
    asked = argparse.ArgumentParser(description="The mapper's poses over many simulated rooms.")
    asked.add_argument("kind", choices=["unknown", "taped"])
    asked.add_argument("--rooms", type=int, default=50)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--jobs", type=int, default=2)
    args = asked.parse_args()
    seeds = range(args.seed, args.seed + args.rooms)
    with ProcessPoolExecutor(args.jobs) as pool:
        if args.kind == "unknown":
            of_unknown = []
            for one in pool.map(unknown, seeds):
                print(_unknown_line(one), flush=True)
                of_unknown.append(one)
            print("\n".join(_unknown_summary(of_unknown)))
        else:
            of_taped = []
            for each in pool.map(taped, seeds):
                print(_taped_line(each), flush=True)
                of_taped.append(each)
            print("\n".join(_taped_summary(of_taped)))


def _unknown_line(one: Unknown) -> str:
    found = one.outcome
    due = f"found {len(set(found.right) & set(one.tellable))} of {len(one.tellable)} tellable"
    parts = [f"{kind} {' '.join(getattr(found, kind)) or '-'}" for kind in ("right", "inexact", "left_open")]
    parts += [f"WRONG {' '.join(found.wrong)}"] if found.wrong else []
    return f"room {one.seed}: {due}; {'; '.join(parts)}; {one.computing_s:.1f} s"


def _unknown_summary(rooms: Sequence[Unknown]) -> list[str]:
    telling = [one for one in rooms if one.tellable]
    due = sum(len(one.tellable) for one in rooms)
    found = sum(len(set(one.outcome.right) & set(one.tellable)) for one in rooms)
    whole = sum(set(one.tellable) <= set(one.outcome.right) for one in telling)
    counts = {kind: sum(len(getattr(one.outcome, kind)) for one in rooms) for kind in ("right", "inexact", "wrong")}
    return [
        f"{found} of {due} tellable units found; all of them in {whole} of {len(telling)} rooms that have any",
        f"of all units found {counts['right']} as exactly as wanted, {counts['inexact']} less exactly, "
        f"{counts['wrong']} at a wrong place, in {len(rooms)} rooms",
        _computing([one.computing_s for one in rooms]),
    ]


def _taped_line(one: Taped) -> str:
    squares = " ".join(f"{each:.1f}" for each in one.squares)
    return f"room {one.seed}: {'; '.join(_faults(one)) or 'whole'}; squares {squares}; {one.computing_s:.1f} s"


def _faults(one: Taped) -> list[str]:
    faults = [f"MISSED {what}" for what in one.verdict.missed] + [f"FALSE {what}" for what in one.verdict.false]
    return faults + [f"CALLED WRONG {unit}" for unit in one.named]


def _taped_summary(rooms: Sequence[Taped]) -> list[str]:
    verdicts, lines = [one.verdict for one in rooms], []
    for kind in ("wall", "corner", "cylinder"):
        due, missed = (sum(what.startswith(kind) for one in verdicts for what in getattr(one, of)) for of in _DUE)
        lines.append(f"{missed} of {due} due {kind}s missed")
    lines.append(
        f"{sum(len(one.false) for one in verdicts)} false objects in {sum(bool(one.false) for one in verdicts)} rooms; "
        f"{sum(len(one.named) for one in rooms)} units called wrong, of {len(rooms)} rooms"
    )
    ours, told = (100 * np.concatenate([getattr(one, of) for one in verdicts]) for of in ("corners_m", "label_fit_m"))
    lines.append(
        f"corners {ours.mean():.3f} cm, told every label {told.mean():.3f}: {ours.mean() / told.mean():.2f} "
        f"times as much ({len(ours)} corners)"
    )
    squares = np.concatenate([one.squares for one in rooms])
    of_whole = [square for one in rooms if not _faults(one) for square in one.squares]
    low, high = honest_bounds(rooms)
    lines.append(
        f"{len(squares)} poses: squared normalised error {squares.mean() / 3:.2f} per coordinate (chi-square at 1 %: "
        f"{low:.2f} to {high:.2f}), median "
        f"{np.median(squares) / chi2.median(3):.2f} of chi-square's; {len(of_whole)} of rooms without a fault: "
        f"{np.sum(of_whole) / 3 / max(len(of_whole), 1):.2f}"
    )
    return [*lines, _computing([one.computing_s for one in rooms])]


_DUE = ("due", "missed")


def _computing(each_s: Sequence[float]) -> str:
    return f"computing a room: median {np.median(each_s):.1f} s, most {max(each_s):.1f} s"


if __name__ == "__main__":
    main()
