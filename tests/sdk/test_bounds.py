"""Every field of every message has bounds, all that real units send lies within them, and what does not is named."""

import math

import pytest
from google.protobuf.timestamp_pb2 import Timestamp

from noctule import bounds, messages_pb2
from noctule.bounds import Counts, Data, Many, Name, Number, Text
from noctule.errors import BoundsError
from noctule.messages_pb2 import (
    CommandRequest,
    Contour,
    Corner,
    Cursor,
    FeaturePoint,
    Features,
    GridTile,
    Pose,
    Reading,
    Sensor,
    ServiceStatus,
    Sweep,
    UnitStatus,
    Wall,
)

MESSAGES = [Timestamp.DESCRIPTOR, *messages_pb2.DESCRIPTOR.message_types_by_name.values()]
FIELDS = {f"{message.name}.{field.name}": field for message in MESSAGES for field in message.fields}
NUMBERS = {"CPPTYPE_INT32", "CPPTYPE_INT64", "CPPTYPE_UINT32", "CPPTYPE_UINT64", "CPPTYPE_DOUBLE", "CPPTYPE_FLOAT"}


def kind(field):
    names = (name for name in vars(type(field)) if name.startswith("CPPTYPE_"))
    return next(name for name in names if getattr(field, name) == field.cpp_type)


def is_map(field):
    return field.message_type is not None and field.message_type.GetOptions().map_entry


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_has_a_bound_of_its_kind(name):
    """So that a new field can't be forgotten; a flag needs none, and a message of its own has one for each field."""
    field = FIELDS[name]
    message, _, field_name = name.partition(".")
    bound = bounds.BOUNDS.get(message, {}).get(field_name)
    if is_map(field):
        assert isinstance(bound, Counts)
    elif field.is_repeated:
        assert isinstance(bound, Many)
        assert (bound.each is None) == (field.message_type is not None)
    elif field.message_type is not None:
        assert field.message_type.name in {message.name for message in MESSAGES}
        assert bound is None
    elif kind(field) in NUMBERS | {"CPPTYPE_ENUM"}:
        assert isinstance(bound, Number)
    elif kind(field) == "CPPTYPE_STRING":
        is_bytes = field.type == field.TYPE_BYTES
        assert isinstance(bound, Data if is_bytes else Text | Name)
    else:
        assert kind(field) == "CPPTYPE_BOOL"
        assert bound is None


def test_no_bound_is_of_a_field_that_is_not_there():
    listed = {f"{message}.{field}" for message, fields in bounds.BOUNDS.items() for field in fields}
    assert listed <= FIELDS.keys()


def test_every_bound_of_a_number_is_finite():
    """And so refuses NaN and the infinities, whatever the field."""
    for fields in bounds.BOUNDS.values():
        for bound in fields.values():
            each = bound.each if isinstance(bound, Many | Counts) else bound
            if isinstance(each, Number):
                assert -math.inf < each.least < each.most < math.inf
                assert all(each.fault(bad) for bad in (math.nan, math.inf, -math.inf))


def status(**counters):
    message = UnitStatus(unit="u1", detail="d" * 2000)
    message.counters.update(counters)
    return message


def timed(seconds):
    return Sweep(start=Timestamp(seconds=seconds))


BEYOND = {
    "sensor.beam_width_rad is 1e-300: give 0.00174533 to 3.14159 rad (the full width of the beam)": Sweep(
        sensor=Sensor(beam_width_rad=1e-300)
    ),
    "pose.heading_rad is 1.7e+308: give -628.319 to 628.319 rad": Sweep(pose=Pose(heading_rad=1.7e308)),
    "pose.sigma_position_m is 1e+160: give 0 to 100 m (in metres)": Sweep(pose=Pose(sigma_position_m=1e160)),
    "readings[3].bearing_rad is 1.7e+308: give -6.28319 to 6.28319 rad": Sweep(
        readings=[Reading()] * 3 + [Reading(bearing_rad=1.7e308)]
    ),
    "readings has 100000 elements, and 64 are allowed": Sweep(readings=[Reading()] * 100_000),
    "sensor.range_sigma_m is 1e-07: give 0.0001 to 0.5 m (in metres)": Sweep(sensor=Sensor(range_sigma_m=1e-7)),
    "air_temperature_c is 294: give -60 to 85 degrees C (in degrees Celsius, not kelvin)": Sweep(air_temperature_c=294),
    "log_sequence is 9007199254740992: give 0 to 9007199254740991": Sweep(log_sequence=2**53),
    "start.seconds is 9000000001: give 0 to 9e+09 s (after 1970)": timed(9_000_000_001),
    "start.seconds is -1": timed(-1),
    "unit is wrong: the name 'xxxxxxxx": UnitStatus(unit="x" * 65536),
    "unit is wrong: the name '*' can't be part of a key": UnitStatus(unit="*"),
    "detail is 'ddd": UnitStatus(detail="d" * 2001),
    "counters has 201 elements, and 200 are allowed": status(**{f"c{n}": n for n in range(201)}),
    "counters's name is 'kkk": status(**{"k" * 65: 1}),
    "counters['k'] is 18446744073709551615": status(k=2**64 - 1),
    "cursors has 4097 elements": ServiceStatus(cursors=[Cursor()] * 4097),
    "occupied has 65537 bytes, and 65536 are allowed": GridTile(occupied=bytes(65537)),
    "walls[1].covariance[2] is nan": Contour(walls=[Wall(), Wall(covariance=[0.0, 0.0, math.nan])]),
    "corners[0].walls has 17 elements": Contour(corners=[Corner(walls=range(17))]),
    "points[0].reliability is 2": Features(points=[FeaturePoint(reliability=2.0)]),
    "pause_s is 1e+12: give 0 to 3600 s": CommandRequest(pause_s=1e12),
}


@pytest.mark.parametrize(("told", "message"), BEYOND.items(), ids=BEYOND)
def test_a_value_beyond_its_bounds_is_named_by_path_value_and_interval(told, message):
    with pytest.raises(BoundsError) as error:
        bounds.check(message)
    assert str(error.value).startswith(told)
    assert len(str(error.value)) < 300


def test_what_is_not_known_is_allowed_to_be_left_out():
    for message in MESSAGES:
        bounds.check(messages_pb2.__dict__.get(message.name, Timestamp)())
    bounds.check(Pose(sigma_position_m=100.0, sigma_heading_rad=math.pi))  # as wide as can be stated


def test_bytes_are_counted_before_they_are_read():
    with pytest.raises(BoundsError, match=r"not a noctule\.v1\.Sweep: it has 1000000 bytes, and 262144 are allowed"):
        bounds.decode(Sweep, bytes(1_000_000))
    with pytest.raises(BoundsError, match=r"not a noctule\.v1\.Sweep: Error parsing"):
        bounds.decode(Sweep, b"\xff")


def test_the_largest_map_fits_its_payload():
    """64 rooms of 16 walls, all numbers of full length."""
    wall = Wall(theta_rad=0.1, rho_m=-1000.1, covariance=[1e-9] * 4, readings=2**32 - 1)
    wall.start.x_m = wall.start.y_m = wall.end.x_m = wall.end.y_m = 1e4 / 3
    corner = Corner(x_m=0.1, y_m=0.1, covariance=[1e-9] * 4, walls=[1023, 1022])
    contour = Contour(walls=[wall] * 1024, corners=[corner] * 1024)
    assert bounds.decode(Contour, contour.SerializeToString()) == contour
    tile = GridTile(columns=256, rows=256, occupied=bytes(2**16), free=bytes(2**16))
    assert bounds.decode(GridTile, tile.SerializeToString()) == tile
