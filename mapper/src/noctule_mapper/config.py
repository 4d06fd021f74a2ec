"""Every parameter of the mapper, its unit in its name: nested, frozen models that a caller may load from any file."""

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from noctule import bounds
from noctule_mapper.choices import DEFAULT_METHOD, DEFAULT_RULE, Method, Rule

SHORTEST_RANGE_M, LONGEST_RANGE_M = 0.001, 20.0  # of any ranger in air; what a range costs grows with its square
Classifier = Literal["tangent-circle", "r2d"]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SensorConfig(_Model):
    """What stands in where a sweep tells nothing of its sensor: the HC-SR04 of Liu et al. 2019, II.A and V.A.

    Who gives ``range_bias_m``, ``air_temperature_c`` or ``face_offset_m`` has measured it; a value that only stands in
    has an error. A mean error beside which no face offset is given counts from the axis: it has the offset in it.
    """

    beam_width_rad: float = Field(default=math.radians(22.5), gt=0, le=math.pi)  # full width
    range_bias_m: float = 0.0023
    range_sigma_m: float | None = Field(default=None, gt=0)  # None: estimated from the survey
    shortest_range_m: float = Field(default=0.02, ge=SHORTEST_RANGE_M, le=LONGEST_RANGE_M)
    longest_range_m: float = Field(default=4.0, ge=SHORTEST_RANGE_M, le=LONGEST_RANGE_M)
    air_temperature_c: float = 20.0
    assumed_bias_sigma_m: float = Field(default=0.003, ge=0)
    assumed_temperature_sigma_k: float = Field(default=5.0, ge=0)
    # From the axis about which the unit turns to the sensor's face.
    face_offset_m: float = Field(default=0.0, ge=-0.2, le=0.2)
    face_offset_sigma_m: float = Field(default=0.0, ge=0, le=0.1)
    # Faces stand 1 to 3 cm off the axis. The mean stays 0, as poses may as well have been measured to the face.
    assumed_face_sigma_m: float = Field(default=0.02, ge=0, le=0.1)

    @property
    def bias_sigma_m(self) -> float:
        """Of ``range_bias_m``."""
        return 0.0 if "range_bias_m" in self.model_fields_set else self.assumed_bias_sigma_m

    @property
    def temperature_sigma_k(self) -> float:
        """Of ``air_temperature_c``."""
        return 0.0 if "air_temperature_c" in self.model_fields_set else self.assumed_temperature_sigma_k


class NoiseConfig(_Model):
    """How the spread of the ranges is estimated where nobody has calibrated it."""

    # The paper's, for contacts and grid, and until there are echoes to tell.
    assumed_sigma_m: float = Field(default=0.0032, gt=0)
    least_sigma_m: float = Field(default=0.001, gt=0)
    most_sigma_m: float = Field(default=0.06, gt=0)
    # Triples are taken with neighbours in each of these bands.
    baseline_edges_m: tuple[float, ...] = (0.08, 0.45, 0.9, 1.6, 2.5)
    widest_deviation_m: float = Field(default=0.2, gt=0)  # a triple that fails Eq. 1 by more tells nothing
    least_triples: int = Field(default=20, ge=3)


class ContactConfig(_Model):
    """Which readings are matched, and the accumulator in which each finds its contact."""

    shortest_baseline_m: float = Field(default=0.1, gt=0)
    longest_baseline_m: float = Field(default=1.3, gt=0)
    partners: int = Field(default=16, ge=2)  # sweeps that a new one is matched with, at most
    beam_slack_rad: float = Field(default=math.radians(2.0), ge=0)
    direction_bins: int = Field(default=20, ge=4)  # across the beam
    curvature_bins: int = Field(default=9, ge=3)  # from a wall to a point
    least_votes: float = Field(default=1.6, gt=0)  # two other sweeps that agree, less their interpolation loss
    simpler_kind_share: float = Field(default=0.85, gt=0, le=1)  # of the best tangent circle's votes
    support_sigmas: float = Field(default=4.0, gt=0)  # a reading that touches the tangent circle misses it by less
    kind_sigmas: float = Field(default=3.0, gt=0)  # of the tangent circle's own error: the simplest kind within them
    # Or the paper's R2d test, which leaves what it can't judge without a kind.
    classifier: Classifier = "tangent-circle"
    r2d_sigmas: float = Field(default=1.0, gt=0)  # Th in sigmas of d = R2d - R2 (Section V.B)
    r2d_threshold_m: float | None = Field(default=None, gt=0)  # Th itself, as the paper sets it: 0.32 cm
    collinear_m: float = Field(default=0.002, gt=0)  # off the line of its two neighbours, at most: Eq. 1 holds on it


class GridConfig(_Model):
    """The reliability grid."""

    cell_m: float = Field(default=0.02, ge=0.002)
    tile_cells: Literal[16, 32, 64, 128, 256] = 64
    # By default 6,500 m2, in 450 MB at the most. Sweeps beyond are left out of the grid.
    most_tiles: int = Field(default=4000, ge=1, le=bounds.MAX_TILES)
    nodes: Literal[12, 16, 32] = 12  # of the fusion integral, per cell
    epsilon_sigmas: float = Field(default=2.0, gt=0)  # the paper's eps, in sigmas of a range
    most_occupied: float = Field(default=0.9, gt=0, lt=1)  # one contact's belief at its very point
    most_free: float = Field(default=0.3, ge=0, lt=1)  # one reading's belief in the space before its arc
    occupied_from: float = Field(default=0.25, gt=0, le=1)  # a cell with such a belief is called occupied
    free_from: float = Field(default=0.6, gt=0, le=1)  # one with such a belief in free space, free


class FeatureConfig(_Model):
    """When a cluster of cells is a feature point."""

    least_occupied: float = Field(default=0.05, gt=0, lt=1)
    # A longer cluster is cut into blocks of this size, each with its own point.
    block_m: float = Field(default=0.2, gt=0)
    curved_block_m: float = Field(default=0.06, gt=0)  # the same round a cylinder


class WallConfig(_Model):
    """The extended Hough transform (Section IV.B-C)."""

    theta_bin_rad: float = Field(default=math.radians(1.0), gt=0)
    rho_bin_m: float = Field(default=0.01, gt=0)
    deviation_sigmas: float = Field(default=5.0, gt=0)  # Eq. 15, with the calibrated sigma
    deviation_rad: float = Field(default=math.radians(6.0), gt=0)  # of a contact's direction from the wall's normal
    least_points: int = Field(default=3, ge=2)  # the paper goes on to two; any two points make a line


class CylinderConfig(_Model):
    """The RANSAC Hough transform for circles (Section IV.D.1)."""

    trials: int = Field(default=400, ge=1)
    seed: int = 1
    sectors: int = Field(default=16, ge=4)
    ring_sigmas: float = Field(default=5.0, gt=0)
    deviation_rad: float = Field(default=math.radians(6.0), gt=0)  # of a contact's direction from the circle's centre
    smallest_radius_m: float = Field(default=0.02, gt=0)
    largest_radius_m: float = Field(default=1.0, gt=0)
    reach_m: float = Field(default=2.0, gt=0)  # from which a cylinder answers: so many sectors should contain points
    least_points: int = Field(default=6, ge=3)
    least_filled: float = Field(default=0.3, ge=0, le=1)  # of the sectors that should contain points
    finalists: int = Field(default=10, ge=1)
    most_sigma_m: float = Field(default=0.05, gt=0)  # of centre and radius: a corner's few points are no circle


class HoughConfig(_Model):
    """The plain Hough transforms of the baseline (Section IV.A); bins as in the extended one."""

    lines: Literal["standard", "randomised"] = "standard"
    theta_bin_rad: float = Field(default=math.radians(1.0), gt=0)
    rho_bin_m: float = Field(default=0.01, gt=0)
    window_rad: float = Field(default=math.radians(8.0), gt=0)  # a peak suppresses lower ones as near as this
    window_m: float = Field(default=0.15, gt=0)
    least_points: int = Field(default=3, ge=2)
    circle_bin_m: float = Field(default=0.01, gt=0)  # tolerance of the circles' accumulator
    smallest_radius_m: float = Field(default=0.02, gt=0)
    largest_radius_m: float = Field(default=1.0, gt=0)
    least_circle_points: int = Field(default=5, ge=3)
    ring_m: float = Field(default=0.015, gt=0)  # a point as near belongs to a peak's line or circle
    pairs: int = Field(default=4000, ge=1)
    triples: int = Field(default=4000, ge=1)
    seed: int = 1


class PartConfig(_Model):
    """Which sweeps of a site are fitted together (see ``readings.parts``)."""

    same_place_m: float = Field(default=0.08, gt=0)
    # Along a dense path: no contact needs a place farther away.
    reach_m: float = Field(default=1.3, gt=0)
    # Where places are few: so many times as far as the second nearest of them.
    steps: float = Field(default=2.0, ge=1)
    # From farther apart no reflector answers two sensors whose longest range is 4 m.
    most_reach_m: float = Field(default=8.0, gt=0)


class PriceConfig(_Model):
    """What an object must gain before it is believed, in nats: those that cost nothing would be added without end."""

    wall_nats: float = Field(default=16.0, gt=0)
    point_nats: float = Field(default=16.0, gt=0)
    cylinder_nats: float = Field(default=20.0, gt=0)
    # An echo from behind an object that is well inside the beam contradicts it.
    contradiction_nats: float = 3.0
    # Of fine sweeps: a wall whose feet are all in one spot, less the farther they lie apart, up to short_wall_m.
    close_feet_nats: float = Field(default=3.0, ge=0)
    # Silence that makes a gap between two feet of a wall a hole.
    hole_nats: float = Field(default=8.0, gt=0)


class RareStopsConfig(_Model):
    """Coarse sweeps from stops so far apart that each hears a wall once: who is compared, and what an object costs.

    A line known to 1.5 degrees and 1 cm among all that lie within 4 m of the sensor is one of e^9.6; that most rooms
    have several walls makes it a little less surprising. Prices along a dense path are higher, since among many
    echoes some agree by chance.
    """

    wall_nats: float = Field(default=8.0, gt=0)
    point_nats: float = Field(default=8.0, gt=0)
    cylinder_nats: float = Field(default=12.0, gt=0)
    longest_baseline_m: float = Field(default=8.0, gt=0)
    # The chance that another stop hears what one hears. In random rooms 49, 25, 14 and 6 % of the echoes on which the
    # sweeps of a stop agree are of what no other of 2, 3, 4 and 5 stops hears.
    hears_too: float = Field(default=0.5, ge=0, lt=1)
    # A wall, or a cylinder, stands if the best map without it is worth so much less.
    sure_nats: float = Field(default=1.5, ge=0)
    # Walls of more echoes than this need no such proof.
    weak_echoes: float = Field(default=4.5, ge=0)
    # A cylinder is heard from all around, so there are more pairs and triples to choose from.
    most_pairs: int = Field(default=6000, ge=1)
    most_triples: int = Field(default=40_000, ge=1)
    # The search by the worth of the whole map is for a room or two.
    most_places: int = Field(default=60, ge=0)


class BeamConfig(_Model):
    """What a sensor hears: how wide, with which chance, and how its echoes err."""

    slack_rad: float = Field(default=math.radians(2.0), ge=0)
    # An echo comes from behind an object when its range is longer by these sigmas and this distance.
    gate_sigmas: float = Field(default=4.0, gt=0)
    behind_m: float = Field(default=0.05, gt=0)
    # Up to near_lobe_m the lobe has this half width, beyond near_lobe_ends_m that of the stated beam.
    near_lobe_rad: float = Field(default=math.radians(20), gt=0)
    near_lobe_m: float = Field(default=0.3, gt=0)
    near_lobe_ends_m: float = Field(default=0.5, gt=0)
    # The share of echoes that come from anywhere, whatever stands before it.
    false_share: float = Field(default=0.04, gt=0, lt=1)
    # The chance that a wall, or a near cylinder, in the beam answers.
    wall_chance: float = Field(default=0.95, gt=0, lt=1)
    # Beyond this range a cylinder's silence proves nothing.
    cylinder_reach_m: float = Field(default=1.5, gt=0)
    # The chance that a corner up to a right angle answers; at obtuse_rad beyond a right angle none does.
    corner_chance: float = Field(default=0.9, gt=0, lt=1)
    obtuse_rad: float = Field(default=math.radians(40), gt=0)
    # A reflex edge answers so close by.
    edge_reach_m: float = Field(default=0.6, gt=0)
    # The chance that a cylinder or edge out of reach, or an obtuse corner, answers all the same.
    faint_chance: float = Field(default=0.1, gt=0, lt=1)
    # The chance that a wall goes on beyond what has been seen of it.
    growth_chance: float = Field(default=0.5, gt=0, lt=1)
    # The share of echoes whose first cycle was missed, and by how much they are longer: 25 us there and back.
    late_share: float = Field(default=0.02, gt=0, lt=1)
    late_m: float = 0.0043


class LinkingConfig(_Model):
    """Which walls meet in a corner, and how far a wall goes on to it."""

    # A wall may win echoes this far beyond what has been seen of it.
    growth_m: float = Field(default=0.4, ge=0)
    # Feet of a corner's echoes look like the wall's beyond its end.
    overshoot_m: float = Field(default=0.4, ge=0)
    least_crossing_sine: float = Field(default=0.04, gt=0)
    # What a link may cost before both ends stay open.
    open_end_nats: float = Field(default=15.0, ge=0)
    # Of coarse sweeps, which look past most gaps: metres must tell.
    longest_gap_m: float = Field(default=4.0, gt=0)
    gap_nats_per_m: float = Field(default=20.0, ge=0)
    # A corner that is heard may be far from its walls' feet.
    most_gap_nats: float = Field(default=35.0, ge=0)
    # Where there are looks: a link whose gap nobody looked at, and each metre of that gap.
    link_nats: float = Field(default=7.5, ge=0)
    unseen_nats_per_m: float = Field(default=2.0, ge=0)
    # Each metre that it is on both sides of the corner: so deep may a wall lie between that nobody has heard.
    between_nats_per_m: float = Field(default=3.5, ge=0)
    # A plateau that no object explains and that, as a wall, would part the corner from its two walls.
    cut_off_nats: float = Field(default=4.0, ge=0)


class LimitConfig(_Model):
    """What an object must be, and how well it must be known, to be part of the contour."""

    # Echoes in one direction from one place count as one when objects are weighed.
    same_place_m: float = Field(default=0.08, gt=0)
    least_places: int = Field(default=3, ge=3)
    # Between two feet of a wall.
    longest_hole_m: float = Field(default=1.2, gt=0)
    # A wall's last foot, farther than this from the next, is not its.
    lone_end_m: float = Field(default=0.5, gt=0)
    # A wall seen along less than this, and no longer between corners at both ends, must be heard from so many places,
    # or it may be a corner's echoes.
    short_wall_m: float = Field(default=0.35, gt=0)
    short_wall_places: int = Field(default=5, ge=3)
    most_theta_sigma_rad: float = Field(default=math.radians(1.5), gt=0)
    # A cylinder's radius against its error: a smaller one may be a corner.
    least_radius_sigmas: float = Field(default=2.5, gt=0)
    most_cylinder_sigma_m: float = Field(default=0.05, gt=0)
    # Of fine sweeps, in place of both: the error of a cylinder's radius as a share of the radius.
    most_radius_sigma_share: float = Field(default=0.25, gt=0)
    most_corner_sigma_m: float = Field(default=0.04, gt=0)


class SearchConfig(_Model):
    """How long objects are sought and fitted."""

    most_pair_echoes: int = Field(default=400, ge=1)
    most_pairs: int = Field(default=1500, ge=1)
    most_triples: int = Field(default=4000, ge=1)
    # Whether a cylinder's echoes are taken from any side, however far their axes are turned from each other.
    cylinders_from_all_around: bool = False
    rounds: int = Field(default=6, ge=1)
    # Steps of the joint fit that has the last word.
    last_steps: int = Field(default=8, ge=1)


class PlateauConfig(_Model):
    """Fine sweeps, in which a reflector answers several bearings: a plateau."""

    # Between two of its bearings, at most.
    gap_steps: float = Field(default=2.3, gt=1)
    # By which ranges at neighbouring bearings may differ.
    sigmas: float = Field(default=2.5, gt=0)
    # The error of its middle as a share of a step, and the least.
    middle_share: float = Field(default=0.25, gt=0)
    least_middle_sigma_rad: float = Field(default=math.radians(0.7), gt=0)


class TouchConfig(_Model):
    """What one place alone tells: touches, and when a right-angled frame makes walls of them."""

    # How often a reflector at one metre is a corner, or a cylinder, for each time that it is a wall: rooms have as many
    # corners as walls and few posts, and what is a point lies more often far away than near.
    corners_per_wall: float = Field(default=0.65, gt=0)
    cylinders_per_wall: float = Field(default=0.6, gt=0)
    # Here the last posts fall silent, the slimmest at cylinder_reach_m.
    cylinders_fade_m: float = Field(default=2.2, gt=0)
    # A room is right-angled about as often as not; the rest makes up for what a frame's evidence leaves out.
    frame_nats: float = Field(default=4.0, ge=0)
    # A side of a frame that nothing answers for, though the sweep passed it: beyond reach, or hidden.
    silent_side_nats: float = Field(default=1.2, ge=0)
    # What a corner's silence may cost: something that the frame knows nothing of may stand before it.
    most_silent_corner_nats: float = Field(default=6.0, ge=0)
    # The chance from which a touch is a wall.
    least_wall_chance: float = Field(default=0.995, gt=0.5, lt=1)
    # How well a corner, or an end of a wall, must be known.
    most_end_sigma_m: float = Field(default=0.015, gt=0)
    # Half the length of a wall of which only the foot has been heard.
    foot_m: float = Field(default=0.03, gt=0)


class RefinementConfig(_Model):
    """Model selection and the joint fit on the raw ranges."""

    prices: PriceConfig = PriceConfig()
    beam: BeamConfig = BeamConfig()
    linking: LinkingConfig = LinkingConfig()
    limits: LimitConfig = LimitConfig()
    search: SearchConfig = SearchConfig()
    plateaus: PlateauConfig = PlateauConfig()
    touches: TouchConfig = TouchConfig()
    rare_stops: RareStopsConfig = RareStopsConfig()


class MapperConfig(_Model):
    """All of it."""

    method: Method = DEFAULT_METHOD
    rule: Rule = DEFAULT_RULE  # by which a cell's beliefs are fused (Section III.A)
    sensor: SensorConfig = SensorConfig()
    noise: NoiseConfig = NoiseConfig()
    parts: PartConfig = PartConfig()
    contacts: ContactConfig = ContactConfig()
    grid: GridConfig = GridConfig()
    features: FeatureConfig = FeatureConfig()
    walls: WallConfig = WallConfig()
    cylinders: CylinderConfig = CylinderConfig()
    hough: HoughConfig = HoughConfig()
    refinement: RefinementConfig = RefinementConfig()


def for_rare_stops(config: MapperConfig) -> MapperConfig:
    """The configuration with the prices, baselines and search of ``rare_stops``."""
    rare = config.refinement.rare_stops
    prices = {name: getattr(rare, name) for name in ("wall_nats", "point_nats", "cylinder_nats")}
    refinement = {  # coarse sweeps have no plateaus, whose feet could lie close
        "prices": config.refinement.prices.model_copy(update={**prices, "close_feet_nats": 0.0}),
        "search": config.refinement.search.model_copy(
            update={
                "most_pairs": rare.most_pairs,
                "most_triples": rare.most_triples,
                "cylinders_from_all_around": True,
            }
        ),
    }
    contacts = config.contacts.model_copy(update={"longest_baseline_m": rare.longest_baseline_m})
    return config.model_copy(
        update={"refinement": config.refinement.model_copy(update=refinement), "contacts": contacts}
    )


class Window(_Model):
    """Which sweeps the map rests on: what is too old, superseded or too many is taken out again."""

    model_config = ConfigDict(allow_inf_nan=False)

    max_age_s: float = Field(default=86_400.0, gt=0, le=1e9)  # of time that has passed; window.py says how
    max_sweeps: int = Field(default=4_000, ge=1, le=20_000)
    # Of a unit's last visit there, in both directions of the stepper: enough to tell who walks by from what changes.
    sweeps_per_place: int = Field(default=8, ge=1)
    place_radius_m: float = Field(default=0.05, gt=0)  # well above the noise of poses, below the steps of a path
    place_heading_rad: float = Field(default=math.radians(15.0), gt=0, le=math.tau)
