"""The sun's azimuth and elevation at a time and location.

The steps are those of [1]: the Earth's heliocentric longitude by VSOP87, nutation, aberration, sidereal time, parallax,
refraction. Longitude has all terms that count, nutation its four largest [2]. The elevation is within 0.001 deg of [1]
from 1900 to 2100, be [1] given the delta T of [3] or its usual 67 s.

References:
    [1] Reda and Andreas, Solar Position Algorithm for Solar Radiation Applications, NREL/TP-560-34302, 2004.
    [2] Meeus, Astronomical Algorithms, 1991, chapter 22.
    [3] Espenak and Meeus, Five Millennium Canon of Solar Eclipses, NASA/TP-2006-214141.
"""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike

from lighting.geometry import Floats

_SUNSET = -0.26667 - 0.5667  # deg: true elevation of the center when the upper edge appears on the horizon [1]
CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, ASTRONOMICAL_TWILIGHT = -6.0, -12.0, -18.0  # deg, where each ends

_J2000 = np.datetime64("2000-01-01T12:00:00")
_DELTA_T = (  # years and seconds, terrestrial minus universal time [3]; 90 s move the sun by 0.001 deg
    (1900, 1910, 1920, 1930, 1940, 1950, 1960, 1970, 1980, 1990, 2000, 2010, 2020, 2100),
    (-2.7, 10.5, 21.2, 24.0, 24.3, 29.1, 33.2, 40.2, 50.5, 56.9, 63.8, 66.1, 69.4, 136.0),  # the last half [3]'s growth
)
_ABERRATION = 20.4898 / 3600  # deg at 1 astronomical unit
_PARALLAX = 8.794 / 3600  # deg at 1 astronomical unit, of a sun on the horizon

# Amplitude [1e-8 rad or astronomical units], phase [rad], frequency [rad per Julian millennium]; one table per power of
# the time.
# fmt: off
_LONGITUDE = (
    ((175347046.0, 0.0, 0.0), (3341656.0, 4.6692568, 6283.07585), (34894.0, 4.6261, 12566.1517),
     (3497.0, 2.7441, 5753.3849), (3418.0, 2.8289, 3.5231), (3136.0, 3.6277, 77713.7715),
     (2676.0, 4.4181, 7860.4194), (2343.0, 6.1352, 3930.2097), (1324.0, 0.7425, 11506.7698),
     (1273.0, 2.0371, 529.691), (1199.0, 1.1096, 1577.3435), (990.0, 5.233, 5884.927), (902.0, 2.045, 26.298),
     (857.0, 3.508, 398.149), (780.0, 1.179, 5223.694), (753.0, 2.533, 5507.553), (505.0, 4.583, 18849.228),
     (492.0, 4.205, 775.523), (357.0, 2.92, 0.067), (317.0, 5.849, 11790.629), (284.0, 1.899, 796.298),
     (271.0, 0.315, 10977.079), (243.0, 0.345, 5486.778), (206.0, 4.806, 2544.314), (205.0, 1.869, 5573.143),
     (202.0, 2.458, 6069.777), (156.0, 0.833, 213.299), (132.0, 3.411, 2942.463), (126.0, 1.083, 20.775),
     (115.0, 0.645, 0.98), (103.0, 0.636, 4694.003), (102.0, 0.976, 15720.839), (102.0, 4.267, 7.114),
     (99.0, 6.21, 2146.17), (98.0, 0.68, 155.42), (86.0, 5.98, 161000.69), (85.0, 1.3, 6275.96),
     (85.0, 3.67, 71430.7), (80.0, 1.81, 17260.15), (79.0, 3.04, 12036.46), (75.0, 1.76, 5088.63),
     (74.0, 3.5, 3154.69), (74.0, 4.68, 801.82), (70.0, 0.83, 9437.76), (62.0, 3.98, 8827.39), (61.0, 1.82, 7084.9),
     (57.0, 2.78, 6286.6), (56.0, 4.39, 14143.5), (56.0, 3.47, 6279.55), (52.0, 0.19, 12139.55),
     (52.0, 1.33, 1748.02), (51.0, 0.28, 5856.48), (49.0, 0.49, 1194.45), (41.0, 5.37, 8429.24),
     (41.0, 2.4, 19651.05), (39.0, 6.17, 10447.39), (37.0, 6.04, 10213.29), (37.0, 2.57, 1059.38),
     (36.0, 1.71, 2352.87), (36.0, 1.78, 6812.77), (33.0, 0.59, 17789.85), (30.0, 0.44, 83996.85),
     (30.0, 2.74, 1349.87), (25.0, 3.16, 4690.48)),
    ((628331966747.0, 0.0, 0.0), (206059.0, 2.678235, 6283.07585), (4303.0, 2.6351, 12566.1517),
     (425.0, 1.59, 3.523), (119.0, 5.796, 26.298), (109.0, 2.966, 1577.344), (93.0, 2.59, 18849.23),
     (72.0, 1.14, 529.69), (68.0, 1.87, 398.15), (67.0, 4.41, 5507.55), (59.0, 2.89, 5223.69), (56.0, 2.17, 155.42),
     (45.0, 0.4, 796.3), (36.0, 0.47, 775.52), (29.0, 2.65, 7.11)),
    ((52919.0, 0.0, 0.0), (8720.0, 1.0721, 6283.0758), (309.0, 0.867, 12566.152), (27.0, 0.05, 3.52),
     (16.0, 5.19, 26.3), (16.0, 3.68, 155.42), (10.0, 0.76, 18849.23), (9.0, 2.06, 77713.77)),
    ((289.0, 5.844, 6283.076),),
)
# fmt: on
_LATITUDE = (((280.0, 3.199, 84334.662), (102.0, 5.422, 5507.553), (80.0, 3.88, 5223.69), (44.0, 3.7, 2352.87)),)
_DISTANCE = (
    ((100013989.0, 0.0, 0.0), (1670700.0, 3.0984635, 6283.07585), (13956.0, 3.05525, 12566.1517)),
    ((103019.0, 1.10749, 6283.07585),),
)


def sun_position(time_utc: ArrayLike | datetime, latitude: ArrayLike, longitude: ArrayLike) -> tuple[Floats, Floats]:
    """Azimuth [deg clockwise from true north, 0 to 360] and apparent elevation [deg] at sea level.

    All arguments broadcast. Refraction is that of 1010 hPa and 10 degrees Celsius, and none below _SUNSET.

    Args:
        time_utc: (...) numpy's datetime64, in UTC; or one aware datetime.
        latitude: (...) deg, positive north.
        longitude: (...) deg, positive east.
    """
    days = _days(time_utc)
    right_ascension, declination, sidereal_time, distance = _geocentric(days)
    hour_angle = np.radians(sidereal_time + np.asarray(longitude, dtype=np.float64)) - right_ascension
    azimuth, elevation = _horizontal(hour_angle, declination, np.radians(latitude))
    topocentric = elevation - _PARALLAX / distance * np.cos(np.radians(elevation))
    return azimuth, topocentric + _refraction(topocentric)


def _days(time: ArrayLike | datetime) -> Floats:
    """Days since noon of 1 January 2000."""
    moment = time.astimezone(UTC).replace(tzinfo=None) if isinstance(time, datetime) else time
    return np.asarray((np.asarray(moment, dtype="datetime64[us]") - _J2000) / np.timedelta64(1, "D"))


def _geocentric(days: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Right ascension and declination [rad] of the sun, Greenwich's apparent sidereal time [deg], distance [au]."""
    delta_t = np.interp(2000.0 + days / 365.25, *_DELTA_T)
    centuries = (days + delta_t / 86400.0) / 36525.0
    distance = _series(_DISTANCE, centuries / 10.0)
    nutation, obliquity = _nutation(centuries)
    longitude = np.degrees(_series(_LONGITUDE, centuries / 10.0)) + 180.0 + nutation - _ABERRATION / distance
    x, y, z = np.cos(np.radians(longitude)), np.sin(np.radians(longitude)), -_series(_LATITUDE, centuries / 10.0)
    cosine, sine = np.cos(np.radians(obliquity)), np.sin(np.radians(obliquity))
    right_ascension = np.arctan2(y * cosine - z * sine, x)  # the latitude z is of millionths
    declination = np.arcsin(y * sine + z * cosine)
    mean_sidereal_time = 280.46061837 + 360.98564736629 * days + 0.000387933 * (days / 36525.0) ** 2
    return right_ascension, declination, mean_sidereal_time + nutation * cosine, distance


def _series(tables: tuple[tuple[tuple[float, float, float], ...], ...], millennia: Floats) -> Floats:
    """The sum of the tables' cosines, each table times its power of the time [Julian millennia]."""
    total = np.zeros_like(millennia)
    for power, terms in enumerate(tables):
        for amplitude, phase, frequency in terms:
            total = total + amplitude * 1e-8 * np.cos(phase + frequency * millennia) * millennia**power
    return total


def _nutation(centuries: Floats) -> tuple[Floats, Floats]:
    """Nutation in longitude and the ecliptic's true obliquity [deg]."""
    node = np.radians(125.04452 - 1934.136261 * centuries)
    sun = np.radians(2 * (280.4665 + 36000.7698 * centuries))
    moon = np.radians(2 * (218.3165 + 481267.8813 * centuries))
    longitude = -17.20 * np.sin(node) - 1.32 * np.sin(sun) - 0.23 * np.sin(moon) + 0.21 * np.sin(2 * node)
    obliquity = 9.20 * np.cos(node) + 0.57 * np.cos(sun) + 0.10 * np.cos(moon) - 0.09 * np.cos(2 * node)
    return longitude / 3600.0, 23.4392911 - 0.0130042 * centuries + obliquity / 3600.0


def _horizontal(hour_angle: Floats, declination: Floats, latitude: Floats) -> tuple[Floats, Floats]:
    """Azimuth in [0, 360) and elevation [deg] from angles in rad."""
    east = -np.cos(declination) * np.sin(hour_angle)
    equatorial = np.cos(declination) * np.cos(hour_angle)
    north = np.sin(declination) * np.cos(latitude) - equatorial * np.sin(latitude)
    up = np.sin(declination) * np.sin(latitude) + equatorial * np.cos(latitude)
    azimuth = np.mod(np.degrees(np.arctan2(east, north)), 360.0)
    return azimuth, np.degrees(np.arctan2(up, np.hypot(east, north)))


def _refraction(elevation: Floats) -> Floats:
    """How much higher [deg] the sun appears (Saemundsson's inverse of Bennett's formula)."""
    bounded = np.maximum(elevation, _SUNSET)
    refraction = 1.02 / (60.0 * np.tan(np.radians(bounded + 10.3 / (bounded + 5.11))))
    return np.where(elevation >= _SUNSET, refraction, 0.0)
