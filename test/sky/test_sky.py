# SPDX-License-Identifier: Apache-2.0
"""The sky beside a second library, and problems that name it. Needs the extra: `make sky`."""

import json
import warnings

import numpy as np
import pytest

from riem_planner.errors import InvalidProblemError
from riem_planner.files.problem_files import parse_problem
from riem_planner.files.resolving import resolved
from riem_planner.geometry import sphere
from riem_planner.sky import Circular, Inertial, Satellite, Site, Sky, Star, Tle

pytestmark = pytest.mark.sky

LINES = (
    "1 25544U 98067A   24001.50000000  .00016717  00000-0  10270-3 0  9009",
    "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.49815350000011",
)
EPOCH = "2024-01-01T12:00:00Z"
LEO = Circular(600.0, 28.5, 40.0, 184.3)
SECONDS = np.linspace(0.0, 6 * 3600.0, 73)
BODIES = {
    "vega": Star(279.234735, 38.783689),
    "kiruna": Site(67.857, 20.964, 390.0),
    "relay": Satellite(Circular(35786.0, 0.1, 10.0, 20.0)),
}


@pytest.fixture(scope="module")
def astropy():
    from astropy import coordinates, time, units
    from astropy.utils import iers

    iers.conf.auto_download = False
    iers.conf.auto_max_age = None
    return coordinates, time, units


def times_of(astropy, epoch):
    _, time, units = astropy
    return time.Time(epoch.rstrip("Z"), scale="utc") + SECONDS * units.s


@pytest.mark.parametrize("orbit", [LEO, Tle(*LINES)], ids=["circular", "tle"])
@pytest.mark.parametrize("name", ["sun", "moon", "mars", "vega"])
def test_apparent_directions_agree_with_astropy_for_six_hours(astropy, orbit, name):
    coordinates, _, units = astropy
    sky = Sky(EPOCH, orbit, BODIES)
    position, velocity = sky.position_velocity(SECONDS)
    times = times_of(astropy, EPOCH)
    # A GCRS of the spacecraft has its light time and its aberration.
    frame = coordinates.GCRS(
        obstime=times,
        obsgeoloc=coordinates.CartesianRepresentation(position.T * units.km),
        obsgeovel=coordinates.CartesianRepresentation(velocity.T * units.km / units.s),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if name == "vega":
            star = coordinates.SkyCoord(279.234735, 38.783689, unit="deg", frame="icrs")
            seen = star.transform_to(frame)
        else:
            with coordinates.solar_system_ephemeris.set("builtin"):
                # Deflection by the Sun is in neither.
                seen = coordinates.get_body(name, times).transform_to(frame)
                seen = seen if name == "moon" else _of_barycentre(coordinates, name, times, frame)
    directions = seen.cartesian.xyz.value.T
    directions = directions / np.linalg.norm(directions, axis=1)[:, None]
    error = np.degrees(sphere.angle(sky.directions(name, SECONDS), directions))
    # The built-in series of astropy are good to a few arc seconds for planets and the Moon.
    assert error.max() < (1e-2 if name == "mars" else 1e-3)


def _of_barycentre(coordinates, name, times, frame):
    """Apparent place of a body by its barycentric place, light time and aberration by the frame."""
    return coordinates.SkyCoord(coordinates.get_body(name, times)).transform_to(frame)


def test_places_of_satellite_and_site_agree_with_astropy(astropy):
    coordinates, _, units = astropy
    from sgp4.api import Satrec

    sky = Sky(EPOCH, Tle(*LINES), BODIES)
    times = times_of(astropy, EPOCH)
    satellite = Satrec.twoline2rv(*LINES)
    _, teme, _ = satellite.sgp4_array(times.utc.jd1, times.utc.jd2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        place = coordinates.TEME(
            coordinates.CartesianRepresentation(teme.T * units.km), obstime=times
        ).transform_to(coordinates.GCRS(obstime=times))
        site = coordinates.EarthLocation.from_geodetic(
            20.964 * units.deg, 67.857 * units.deg, 390.0 * units.m
        ).get_gcrs(times)
    position = sky.position_velocity(SECONDS)[0]
    assert np.abs(position - place.cartesian.xyz.to_value(units.km).T).max() < 1e-2
    ground = sky.places("kiruna", SECONDS) + position
    assert np.abs(ground - site.cartesian.xyz.to_value(units.km).T).max() < 0.05


def test_paths_are_right_between_their_samples():
    sky = Sky(EPOCH, LEO, BODIES)
    fine = np.linspace(0.0, 5400.0, 5401)
    for name in ("sun", "moon", "earth", "relay"):
        path = sky.path(name, 0.0, 5400.0)
        error = sphere.angle(path.direction_at(fine), sky.directions(name, fine))
        assert np.degrees(error.max()) < 1e-5
        assert path.times.size < 2000


def test_limb_of_a_low_orbit_is_its_horizon():
    limb = Sky(EPOCH, LEO).limb("earth", 0.0, 600.0, np.radians(28.0))
    horizon = np.degrees(np.arcsin(6378.137 / 6978.137))
    np.testing.assert_allclose(np.degrees(limb.half_angles), horizon + 28.0, atol=1e-9)
    sun = Sky(EPOCH, LEO).limb("sun", 0.0, 600.0)
    np.testing.assert_allclose(np.degrees(sun.half_angles), 0.271, atol=0.001)


def test_two_body_orbit_by_state_follows_the_circular_one_and_closes():
    sky = Sky(EPOCH, LEO)
    position, velocity = (x[0] for x in sky.position_velocity(np.zeros(1)))
    same = Sky(EPOCH, Inertial(position, velocity)).position_velocity(SECONDS)
    for a, b in zip(same, sky.position_velocity(SECONDS), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-6)
    ellipse = Inertial(position, 1.2 * velocity)
    period = 2 * np.pi * np.sqrt((np.linalg.norm(position) / (2 - 1.44)) ** 3 / 398600.4418)
    there = ellipse.position_velocity(sky.epoch, np.array([0.0, period]))[0]
    np.testing.assert_allclose(there[1], there[0], atol=1e-5)


def test_local_frame_has_nadir_below_and_the_velocity_ahead():
    sky = Sky(EPOCH, Tle(*LINES))
    z, y = (path.direction_at(300.0) for path in sky.lvlh(0.0, 600.0))
    position, velocity = (x[0] for x in sky.position_velocity(np.array([300.0])))
    np.testing.assert_allclose(z, -position / np.linalg.norm(position), atol=1e-8)
    assert np.cross(y, z) @ velocity / np.linalg.norm(velocity) > 0.9999


def problem(**more):
    start = {"orientation": [0, 0, 0, 1]}
    tle = {"tle": list(LINES)}
    return {"space": "so3", "duration": 120, "start": start, "epoch": EPOCH, "orbit": tle} | more


def test_problem_by_name_states_the_same_as_its_resolved_one():
    site = {"latitude_deg": 51.32, "longitude_deg": 80.887, "altitude_m": 100}
    stated = problem(hold=90, bodies={"site": site}, goal={"boresight": [0, 0, 1], "body": "site"})
    result = json.loads(json.dumps(resolved(stated)))
    assert not {"epoch", "orbit", "bodies"} & set(result)
    first, second = parse_problem(stated), parse_problem(result)
    one, other = (each.goal.arrival(120.0).orientation for each in (first, second))
    np.testing.assert_array_equal(one, other)
    assert first.goal.direction.end == 210.0


WRONG = {
    "behind the Earth": (
        {"goal": {"boresight": [0, 0, 1], "body": "x"},
         "bodies": {"x": {"latitude_deg": -51, "longitude_deg": 261}}},
        "goal.body", "below the Earth's limb at the arrival",
    ),
    "sets during the hold": (
        {"goal": {"boresight": [0, 0, 1], "body": "x"}, "hold": 600,
         "bodies": {"x": {"latitude_deg": 51.32, "longitude_deg": 80.887}}},
        "goal.body", "below the Earth's limb during the hold",
    ),
    "epoch outside": ({"epoch": "2070-01-01T00:00:00Z"}, "epoch",
                      "2070 is outside the ephemeris (1900 to 2053)"),
    "local time": ({"epoch": "2027-03-01T06:00:00"}, "epoch", "expected UTC that ends in Z"),
    "no time": ({"epoch": "soon"}, "epoch", "expected UTC that ends in Z"),
    "decayed": ({"epoch": "2039-01-01T00:00:00Z"}, "orbit.tle", "SGP4"),
    "limb of mars": (
        {"obstacles": [{"kind": "keep_out", "body": "mars", "limb_angle_deg": 3}]},
        "obstacles[0].limb_angle_deg", "sun, moon or earth",
    ),
    "limb of everything": (
        {"obstacles": [{"kind": "keep_out", "body": "earth", "limb_angle_deg": 130}]},
        "obstacles[0].limb_angle_deg", "below 180",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_the_sky_does_not_allow_is_named_with_its_key(case):
    more, key, words = WRONG[case]
    stated = problem(goal={"boresight": [0, 0, 1], "body": "sun"}) | more
    with pytest.raises(InvalidProblemError) as caught:
        resolved(stated)
    assert caught.value.key == key
    assert words in str(caught.value)


def test_old_elements_are_told():
    zone = {"kind": "keep_out", "body": "sun", "half_angle_deg": 30, "normalized_strength": 0.01}
    goal = {"orientation": [0, 0, 0, 1]}
    stated = problem(epoch="2024-01-20T12:00:00Z", goal=goal, obstacles=[zone])
    assert "19.0 days after" in resolved(stated)["notes"][0]
