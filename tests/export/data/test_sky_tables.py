"""The reader of the Prague model's data set, and the fit of the table, on sets made here."""

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

import export.data.sky_tables as sky_tables
from export.data.sky_tables import (
    HOSEK_WILKIE_TABLE,
    _installed_datasets,
    _make_hosek_wilkie_table,
    _read_prague,
    _read_sky,
    _read_tensors,
    _rgb_weights,
)
from lighting.geometry import Floats, direction
from lighting.sky.clear_sky import SUN_ANGLES, SUN_ELEVATIONS, VISIBILITIES, ZENITH_ANGLES

CHANNELS = 10


def data_set(visibilities: Floats, elevations: Floats, albedos: int = 1) -> bytes:
    """A set of rank 2 whose radiance is visibility x (1 + channel) x ((2 - sun angle / pi) + 3 x 1) x (1 + zenith)."""
    lists = [np.asarray(values, dtype="<f8") for values in (visibilities, np.full(albedos, 1 / 3), [0.0], elevations)]
    head = b"".join(np.int32(len(values)).tobytes() + values.tobytes() for values in lists)
    head += np.int32(CHANNELS).tobytes() + np.array([360.0, 40.0]).tobytes() + np.int32(2).tobytes()
    breaks = np.linspace(0, np.pi, 5)
    head += 3 * (np.int32(5).tobytes() + breaks.tobytes())
    skies = []
    for visibility in visibilities:
        for _ in elevations:
            for channel in range(CHANNELS):
                for sun, zenith in ((2 - breaks / np.pi, np.ones(5)), (np.ones(5), np.full(5, 3.0))):
                    scale = np.float64(4.0)
                    skies.append(
                        sun.astype("<f2").tobytes() + scale.tobytes() + (zenith * scale).astype("<f2").tobytes()
                    )
                skies.append((visibility * (1 + channel) * (1 + breaks)).astype("<f2").tobytes())
    return head + b"".join(skies) + b"the rest is not read"


def test_reads_what_the_set_says() -> None:
    data = _read_prague(data_set(np.array([20.0, 40.0]), np.array([-2.0, 0.0, 60.0])))
    assert data.visibilities.tolist() == [20.0, 40.0]
    assert data.sun_elevations.tolist() == [-2.0, 0.0, 60.0]
    assert data.wavelengths.tolist() == [360.0 + 40 * edge for edge in range(11)]
    assert data.sun.shape == data.zenith.shape == (2, 3, CHANNELS, 2, 5)
    assert data.zenith[1, 2, 3, 1].tolist() == [3.0] * 5
    sun, view = direction(0.0, 30.0), direction(90.0, 20.0)
    up = np.degrees(np.arccos((view[1] + 0.00396) / np.hypot(np.cos(np.radians(20)), view[1] + 0.00396)))
    gamma = np.degrees(np.arccos(sun @ view))
    spectrum = 30.0 * (1 + np.arange(CHANNELS)) * (2 - gamma / 180 + 3) * (1 + np.radians(up))
    radiance = _read_sky(data, view[None], sun, 30.0)
    assert radiance[0] == pytest.approx(spectrum @ _rgb_weights(data), rel=2e-3)


def test_other_sets_are_refused() -> None:
    with pytest.raises(ValueError, match="not a data set of one albedo and one altitude"):
        _read_prague(data_set(np.array([20.0]), np.array([0.0]), albedos=2))
    with pytest.raises(ValueError, match="not the visibilities and suns of the table"):
        sky_tables._make_prague_table(_read_prague(data_set(np.array([20.0]), np.array([0.0]))))


def test_equal_energy_is_nearly_white() -> None:
    """Rec.709's white is a little bluer than a spectrum of equal energy."""
    weights = _rgb_weights(_read_prague(data_set(np.array([20.0]), np.array([0.0]))))
    assert weights.sum(axis=0) == pytest.approx([1.203, 0.951, 0.910], abs=2e-3)


def test_the_table_holds_the_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sky_tables, "_STEPS", 1)
    monkeypatch.setattr(sky_tables, "_VISIBLE", CHANNELS)
    visibilities, elevations = VISIBILITIES[2:3], SUN_ELEVATIONS[9:10]
    monkeypatch.setattr(sky_tables, "VISIBILITIES", visibilities)
    monkeypatch.setattr(sky_tables, "SUN_ELEVATIONS", elevations)
    table = sky_tables._make_prague_table(data := _read_prague(data_set(visibilities, elevations))).astype(np.float64)
    v, e, split = 0, 0, len(SUN_ANGLES)
    stops = table[v, e, 1, :split] @ table[v, e, 1, split:].T
    sun, nodes = direction(0.0, float(elevations[e])), direction(np.array([0.0, 40.0, 170.0]), 30.0)
    expected = np.log2(_read_sky(data, nodes, sun, 40.0)[:, 1])
    gamma = np.degrees(np.arccos(nodes @ sun))
    across = np.array([np.interp(gamma, SUN_ANGLES, column) for column in stops.T])
    found = [np.interp(60.0, ZENITH_ANGLES, column) for column in across.T]
    assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("wheel", [True, False])
def test_the_set_is_read_from_a_wheel_too(tmp_path: Path, wheel: bool) -> None:
    path = tmp_path / ("some.whl" if wheel else "some.dat")
    if wheel:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("lib/PragueSkyModelReduced.dat", b"the set")
    else:
        path.write_bytes(b"the set")
    assert sky_tables._read_source(path) == b"the set"


def tensor_file() -> bytes:
    values = np.arange(6, dtype="<f8").reshape(2, 3)
    field = struct.pack("<H", 4) + b"some" + struct.pack("<HBQ", 2, 11, 18 + 6 + 11 + 16) + struct.pack("<2Q", 2, 3)
    return b"tensor_file\0\x01\0" + struct.pack("<I", 1) + field + values.tobytes()


def test_reads_names_shapes_and_values() -> None:
    tensors = _read_tensors(tensor_file())
    assert list(tensors) == ["some"]
    assert tensors["some"].tolist() == [[0, 1, 2], [3, 4, 5]]


def test_refuses_other_files() -> None:
    with pytest.raises(ValueError, match="not a Mitsuba tensor file"):
        _read_tensors(b"PK\x03\x04")


@pytest.mark.needs("mitsuba")
def test_the_shipped_table_is_what_the_script_makes(tmp_path: Path) -> None:
    _make_hosek_wilkie_table(_installed_datasets(), tmp_path / "table.f32")
    assert (tmp_path / "table.f32").read_bytes() == HOSEK_WILKIE_TABLE.read_bytes()
