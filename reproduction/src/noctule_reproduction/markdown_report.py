"""The report in Markdown: tables and figures with the seeds and parameters that they come from."""

import math
from collections.abc import Sequence

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.voting import Kind
from noctule_reproduction import paper, tables
from noctule_reproduction.calibration_figures import GROUPS, REPEATS
from noctule_reproduction.comparison import FAR_CM, Spread
from noctule_reproduction.experiments import Experiments
from noctule_reproduction.pictures import Picture, seeds_text
from noctule_reproduction.radius_figures import THRESHOLD_M, TRIES

_OPENING = """# Liu et al. 2019, reproduced in simulation

"DSmT based Ultrasonic Detection Model for Estimating Indoor Environment Contour", its figures and tables made again by
Noctule's mapper. **The paper measured on a real rig; everything of ours is simulated.** A simulated sensor in an exact
room is kinder than a real one, so our smaller errors say nothing against the paper's: compare our columns with each
other, and theirs with theirs.

- Seeds: {count}, {seeds}; ± is the standard deviation over them.
- Room: Tables I-III, real data. Path: the rectangle from (-70, -45) to (200, 105) cm in steps of 20 cm, 44 positions.
- Sensor: 13 bearings from -135 to 135 degrees, a beam of 22.5 degrees. It hears the nearest reflector in the beam: a
  wall only from the foot of its perpendicular, a corner by double bounce, a cylinder from its nearest point.
- Noise: Gaussian, sigma {sigma_cm} cm. The mean of {mean_cm} cm is taken off as calibrated, and the air's temperature
  is known.
- Methods: `hough`, the paper's baseline (bins of {bin_deg:.0f} degree and {bin_cm:.0f} cm, RHT for circles);
  `eht-lsm`, the paper's own chain (Eq. 15 with {deviation_sigmas:.0f} sigma); `refined`, ours, on the raw ranges.
- Fusion: PCR6+, exact for any number of readings.
- `{recording}` is a Rerun recording of the survey of seed {first}, sweep by sweep, by `refined`."""

_TABLES = """## Tables

**Table I.** The walls' lines. {source}

{table_1}

**Table II.** Where the walls meet. The average error is the mean over the corners that each seed has. HT's
x of corner D is printed so; see the end. {source}

{table_2}

**Table III.** The cylinder. {source}

{table_3}

**Found and missed.** An object is found within {far_cm:.0f} cm of a true one. Ours alone, simulated, {seeds}.

{counts}"""

_SOURCE = """Columns HT, RHT, EHT and LSM: the paper's, real rig. Columns hough, eht-lsm and refined: ours, simulated,
{seeds}, mean ± standard deviation."""

_CLASSIFIERS = """## Wall or cylinder (Section II.B)

How many readings have which kind: rows by the tangent circle of all readings that touch it, columns by the paper's R2d
test, Eq. 1-2, with Th = sigma of d. R2d says nothing of readings without a neighbour on either side in line with them,
and has no corners. Simulated, {seeds}; the paper gives no such figures of its real rig.

| tangent circle | R2d: wall | R2d: cylinder | R2d: nothing |
| --- | ---: | ---: | ---: |
{rows}"""

_CALIBRATIONS = """## Calibration (Section V.A)

{groups} groups of three positions, {repeats} readings at each. Paper: real rig. Ours: simulated, {seeds}, ranges with a
mean error of {mean_cm} cm and a sigma of {sigma_cm} cm. In d = R2d - R2 a common mean cancels, and sigma grows by 1.22:
the paper's mean of d can't be the mean error of its ranges. That is known only where the wall's distance is measured.

| | paper, real rig | ours, simulated |
| --- | ---: | ---: |
| mean of d (cm) | {mean_cm:.2f} | {mean_d} |
| sigma of d (cm) | {sigma_cm:.2f} | {sigma_d} |
| sigma of a range (cm) | | {sigma_range} |
| mean error of a range, the wall's distance given (cm) | | {mean_range} |"""

_RADII = """## Cylinders that are told from a wall (Section V.B)

30 cm before three positions 20 cm apart, Th = sigma of d = {threshold_cm:.2f} cm, {tries} tries for each seed.
Simulated, {seeds}; the paper says of its real rig that all four cylinders are detected.

| | mean of d (cm) | told right at Th = sigma (%) | at 3 sigma (%) |
| --- | ---: | ---: | ---: |
{rows}"""


def report(results: Experiments, pictures: Sequence[Picture], recording: str) -> str:
    """The whole report; ``recording`` is the name of the Rerun file beside it. The same results give the same bytes."""
    parts = [_opening(results, recording), _tables(results), _classifiers(results), _calibrations(results)]
    parts += [_radii(results), "## Figures", *(_figure(picture) for picture in pictures), _slips()]
    return "\n\n".join(parts) + "\n"


def _opening(results: Experiments, recording: str) -> str:
    config = MapperConfig()
    return _OPENING.format(
        count=len(results.seeds),
        seeds=seeds_text(results.seeds),
        first=results.seeds[0],
        sigma_cm=paper.SIGMA_CM,
        mean_cm=paper.MEAN_CM,
        bin_deg=math.degrees(config.hough.theta_bin_rad),
        bin_cm=100 * config.hough.rho_bin_m,
        deviation_sigmas=config.walls.deviation_sigmas,
        recording=recording,
    )


def _tables(results: Experiments) -> str:
    ours = results.comparisons
    return _TABLES.format(
        source=" ".join(_SOURCE.format(seeds=seeds_text(results.seeds)).split()),
        table_1=tables.table_1(ours),
        table_2=tables.table_2(ours),
        table_3=tables.table_3(ours),
        far_cm=FAR_CM,
        seeds=seeds_text(results.seeds),
        counts=tables.counts(ours),
    )


def _classifiers(results: Experiments) -> str:
    names = {Kind.WALL: "wall", Kind.CYLINDER: "cylinder", Kind.CORNER: "corner", Kind.NONE: "nothing"}
    columns = (Kind.WALL, Kind.CYLINDER, Kind.NONE)
    rows = [
        f"| {name} | {' | '.join(str(results.contacts[kind, column]) for column in columns)} |"
        for kind, name in names.items()
    ]
    return _CLASSIFIERS.format(seeds=seeds_text(results.seeds), rows="\n".join(rows))


def _calibrations(results: Experiments) -> str:
    found = results.calibrations
    return _CALIBRATIONS.format(
        groups=GROUPS,
        repeats=REPEATS,
        seeds=seeds_text(results.seeds),
        mean_cm=paper.MEAN_CM,
        sigma_cm=paper.SIGMA_CM,
        mean_d=_pair(found.mean_d),
        sigma_d=_pair(found.sigma_d),
        sigma_range=_pair(found.sigma_range),
        mean_range=_pair(found.mean_range),
    )


def _radii(results: Experiments) -> str:
    rows = []
    for one in results.reflectors:
        name = f"cylinder of {100 * one.radius_m:.2f} cm" if math.isfinite(one.radius_m) else "wall"
        share, share_3 = one.told_right
        d_cm = 100 * float(one.deviation_m.mean())
        rows.append(f"| {name} | {_plain(d_cm, 2)} | {100 * share:.1f} | {100 * share_3:.1f} |")
    return _RADII.format(
        threshold_cm=100 * THRESHOLD_M, tries=TRIES, seeds=seeds_text(results.seeds), rows="\n".join(rows)
    )


def _figure(picture: Picture) -> str:
    return f"![Figure {picture.number}]({picture.name}.png)\n\n**Fig. {picture.number}.** {picture.caption}"


def _slips() -> str:
    lines = (f"- {slip}" for slip in paper.SLIPS)
    return "\n".join(("## What the paper prints wrong in these tables and figures", "", *lines))


def _pair(found: Spread) -> str:
    return f"{_plain(found.mean, 3)} ± {found.deviation:.3f}"


def _plain(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}"  # no -0.00
