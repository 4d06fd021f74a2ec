"""Tables I-III in Markdown: the paper's columns beside ours, mean and standard deviation over the seeds."""

from collections.abc import Mapping, Sequence

from noctule_mapper.choices import Method
from noctule_reproduction import paper
from noctule_reproduction.comparison import Comparison, Spread

_HEADINGS = {"hough": "hough", "eht-lsm": "eht-lsm", "refined": "refined"}
_PRINTED: tuple[paper.Column, ...] = ("hough", "eht-lsm")


def table_1(ours: Mapping[Method, Comparison]) -> str:
    """Theta and rho of the walls."""
    rows = []
    for wall in range(len(paper.LINES["true"])):
        for value, (name, digits) in enumerate((("theta (rad)", 4), ("rho (cm)", 3))):
            printed = [f"{paper.LINES[column][wall][value]:.{digits}f}" for column in ("true", *_PRINTED)]
            found = [_cell(one.walls[wall][value], one.seeds, digits) for one in ours.values()]
            rows.append([f"{wall + 1} {name}", *printed, *found])
    return _table(_heading("wall", "HT", ours), rows)


def table_2(ours: Mapping[Method, Comparison]) -> str:
    """Coordinates and errors of the corners."""
    rows = []
    for corner, letter in enumerate(paper.CORNER_NAMES):
        for value, axis in enumerate("xy"):
            printed = [f"{paper.CORNERS[column][corner][value]:.3f}" for column in ("true", *_PRINTED)]
            found = [_cell(one.corners[corner][value], one.seeds, 2) for one in ours.values()]
            rows.append([f"{letter} {axis} (cm)", *printed, *found])
        errors = [f"{paper.CORNER_ERRORS_CM[column][corner]:.3f}" for column in _PRINTED]
        found = [_cell(one.corners[corner][2], one.seeds, 2) for one in ours.values()]
        rows.append([f"{letter} error (cm)", "", *errors, *found])
    means = [f"**{paper.MEAN_CORNER_ERROR_CM[column]:.3f}**" for column in _PRINTED]
    found = [f"**{_cell(one.corner_error, one.seeds, 2)}**" for one in ours.values()]
    return _table(_heading("corner", "HT", ours), [*rows, ["**average error (cm)**", "", *means, *found]])


def table_3(ours: Mapping[Method, Comparison]) -> str:
    """The cylinder."""
    rows = []
    for value, name in enumerate(("x (cm)", "y (cm)", "R (cm)")):
        printed = [f"{paper.CYLINDER[column][value]:.1f}" for column in ("true", *_PRINTED)]
        rows.append([f"F {name}", *printed, *(_cell(one.cylinder[value], one.seeds, 2) for one in ours.values())])
    errors = (("centre", paper.CENTRE_ERRORS_CM), ("radius", paper.RADIUS_ERRORS_CM))
    for value, (name, printed_cm) in enumerate(errors, start=3):
        printed = [f"**{printed_cm[column]:.2f}**" for column in _PRINTED]
        found = [f"**{_cell(one.cylinder[value], one.seeds, 2)}**" for one in ours.values()]
        rows.append([f"**F error of the {name} (cm)**", "", *printed, *found])
    return _table(_heading("cylinder", "RHT", ours), rows)


def counts(ours: Mapping[Method, Comparison]) -> str:
    """What each method missed and invented over all seeds."""
    rows = [[method, str(11 * one.seeds), str(one.missed), str(one.surplus)] for method, one in ours.items()]
    notes = [f"{method}: {note}." for method, one in ours.items() for note in one.notes]
    return "\n\n".join([_table(["method", "walls, corners and cylinders there", "missed", "too many"], rows), *notes])


def _heading(what: str, baseline: str, ours: Mapping[Method, Comparison]) -> list[str]:
    names = [f"{_HEADINGS[method]}, simulated" for method in ours]
    return [what, "true", f"paper's {baseline}, real rig", "paper's EHT and LSM, real rig", *names]


def _cell(found: Spread, seeds: int, digits: int) -> str:
    """``mean ± deviation``, with the number of seeds that have one where some have none."""
    if not found.count:
        return "never found"
    some = "" if found.count == seeds else f" ({found.count} of {seeds})"
    return f"{found.mean:.{digits}f} ± {found.deviation:.{digits}f}{some}"


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heading, ["---"] + ["---:"] * (len(heading) - 1), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
