"""What stands beneath each figure: what it shows and by which parameters; where its data come from is added to it."""

_ROOM = "room of Tables I-III, the paper's path, 13 bearings 22.5 degrees apart, range sigma 0.32 cm, mean taken off"

_TEXTS = {
    3: """Beliefs across the arc of a reading of R = 3.0 m, eps = 2 mm, beam 22.5 degrees, at (a) 5, (b) 15 and (c) 10
        degrees off the axis, by Eq. 5-8. Dashed: Eq. 7 as printed, surely free off the arc; solid: corrected, free
        before the arc and unknown behind it. At 15 degrees the beam has ended, and the reading knows nothing.""",
    5: f"""Readings of part of wall 1 ({_ROOM}): (a) m(O) of whole arcs, Eq. 6, the highest of any reading; (b) m(O) of
        each reading's contact region of central angle 6 eps / R, eps = 2 sigma. Dots: the sensor; dashed: the true
        wall. Cells of 2 mm.""",
    6: f"""The contact regions of Fig. 5 (b), fused by PCR6+ over all readings ({_ROOM}). Cells of 2 mm.""",
    7: f"""Readings of the cylinder F ({_ROOM}): (a) arcs, (b) contact regions, (c) fused by PCR6+. Dashed: the true
        cylinder. Cells of 2 mm.""",
    9: """The Hough transform: (a) theta and rho of wall 1 of Table I, real data; (b) six points on it as curves, Eq. 9,
        which meet at its theta and rho.""",
    11: f"""Votes of the feature points on walls for lines, Eq. 9, in bins of 1 degree and 1 cm ({_ROOM}): (a) all, of
        every four bins of rho the highest; (b) about the highest peak.""",
    12: f"""The classes that the extended Hough transform makes of the feature points on walls: the highest peak, the
        deviation test (Eq. 15 corrected), then the same without them ({_ROOM}).""",
    13: """The calibration: (a) {groups} groups of three positions 20 cm apart before a wall, {repeats} readings at
        each; (b) d = R2d - R2 with its Gaussian, and the paper's. A range errs by a mean of 0.23 cm and a sigma of 0.32
        cm; in d the mean cancels, and sigma grows by 1.22. From d: sigma of a range {sigma_range_cm:.3f} cm.
        Shapiro and Wilk's test of d: p = {gaussian_p:.2f}.""",
    14: """The R2d test with Th = sigma on cylinders of radius 6.77, 11.37, 15.37 and 19.90 cm, 30 cm before the middle
        of three positions 20 cm apart: (a)-(d) arcs of one try; (e) d of all, {tries} tries for each seed, and of a
        wall as far away. Range sigma 0.32 cm, hence sigma of d, and Th, {threshold_cm:.2f} cm. A third of the wall's
        tries look like a cylinder then.""",
    15: """(a) A cylinder of radius R before the middle of three positions; (b) the greatest R that a deviation d tells
        from a wall, against the distance L: Eq. 24-25 corrected (625 cm - L for 20 cm and 0.32 cm) and as printed
        (312.5 cm - L; 104.16 cm - L with 3 sigma).""",
    17: f"""(a) The environment; (b) the 44 positions; (c) the reliability grid after the survey, cells of 2 cm, PCR6+;
        (d) its feature points by kind and the contour of EHT + LSM ({_ROOM}).""",
    18: f"""Left: contours of the first seed by each method, and the paper's EHT + LSM (violet). Right: where each seed
        has each corner and the cylinder's centre, off the true place; the insets enlarge it, and places beyond a panel
        are counted in its corner. Violet marks are the
        paper's; HT's corner D is from the lines of its Table I ({_ROOM}).""",
}


def simulated(number: int, data: str, **values: float) -> str:
    """The caption of a figure of simulated ``data``, such as ``seeds 1 to 50``; ``values`` go into its text."""
    return f"{_text(number, values)} Ours is simulated ({data}); the paper's is of its real rig."


def computed(number: int, seeds: str) -> str:
    """The caption of a figure that shows formulae alone."""
    return (
        f"{_text(number, {})} It shows formulae: nothing in it comes from the paper's real rig or was simulated, "
        f"and {seeds} share it."
    )


def _text(number: int, values: dict[str, float]) -> str:
    return " ".join(_TEXTS[number].format(**values).split())
