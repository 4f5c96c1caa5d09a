"""How far the network understates a sun that shines: the fit of a constant in lighting/strength.py.

A network that minimises errors keeps to the middle: of a sun that surely shines it still says a little less than such
suns give. Of the ordinary photos of `train` it learnt the direction alone, so what it says of the power of the sun in
those taken in direct sunlight is compared with the suns of the unclipped HDR panoramas, by the ratio of sun to sky over
that of a clear sky with the sun at the same height.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from export.crops import clear_ratio, irradiance_of, load_sources
from export.data import DataError, needed_photo_rows, read_index
from export.evaluation.tables import table
from lighting.colour import luminance
from lighting.evidence import said_of
from lighting.geometry import Floats
from lighting.model import Model
from lighting.photo import read_photo

LEAST_ELEVATION = 1.0  # deg, of the sun, under which a clear sky says little of its power


def over_clear(sun: Sequence[Floats], sky: Sequence[Floats], elevation: Sequence[float]) -> Floats:
    """Stops (N,) of the luminance of suns (3,) over that of skies (3,) above clear skies with suns at elevations [deg].

    Of a clear sky it is the luminance of the channels' ratios: it only has to be the same for all that are compared.
    """
    said = luminance(np.array(sun)) / luminance(np.array(sky))
    clear = luminance(np.array([clear_ratio(round(e)) for e in elevation]))
    return np.asarray(np.log2(said / clear))


def of_panoramas(data: Path, labels: Path) -> Floats:
    """What the sunny HDR panoramas of `train` with an unclipped sun have over a clear sky [stops]."""
    panoramas = [p for p in read_index(data, "train") if p.kind == "hdr" and p.direct == "yes"]
    known = [(s, irradiance_of(s)) for s in load_sources(panoramas, labels)]
    seen = [(s.label.sun_elevation, light) for s, light in known if s.panorama.sun_is_unclipped]
    if not seen:
        raise DataError(f"{data} has no sunny HDR panorama in `train` whose sun is unclipped.")
    return over_clear([light.sun for _, light in seen], [light.sky for _, light in seen], [e for e, _ in seen])


def of_photos(model: Model, data: Path) -> Floats:
    """What the network says of the photos of `train` in direct sun, over a clear sky [stops]."""
    rows = [r for r in needed_photo_rows(data) if r.direct == "yes" and r.sun_elevation >= LEAST_ELEVATION]
    lights = [said_of(model, read_photo(row.path)).light for row in rows]
    said = [(light, row.sun_elevation) for light, row in zip(lights, rows, strict=True) if light is not None]
    if not said:
        raise DataError(f"No photo of {data} was taken in direct sun, or the network says nothing of the light.")
    suns, skies = ([getattr(light, name) for light, _ in said] for name in ("sun_irradiance", "sky_irradiance"))
    return over_clear(suns, skies, [elevation for _, elevation in said])


def sun_power_report(model: Model, data: Path, labels: Path) -> str:
    """The stops that are missing, and quartiles of both sides."""
    sides = {"HDR panoramas, unclipped sun": of_panoramas(data, labels), "photos, as said": of_photos(model, data)}
    true, said = (float(np.median(values)) for values in sides.values())
    header = ["`train`, in direct sun", "number", "sun / sky over a clear sky, median [stops]", "quartiles"]
    rows = []
    for name, values in sides.items():
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
        rows.append([name, str(len(values)), f"{middle:+.2f}", f"{low:+.2f} to {high:+.2f}"])
    return f"A sun that shines is understated by {true - said:.2f} stops\n\n{table(header, rows)}"
