"""A light with another sun, turbidity, exposure or power, as a user sets them by hand."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lighting.colour import luminance
from lighting.envmap.clear import clear_irradiance, lobe_table
from lighting.envmap.disc import disc_power
from lighting.geometry import Floats
from lighting.records import Colour, Lighting, check_lighting, clipped_colour

_LEAST = 1e-9  # irradiance that stands for none
_LOWEST = 5.0  # deg; the model's suns below it have hardly any green and no blue, and photos' suns have
_HIGH = 30.0  # deg, of a sun at full strength
_WEAKEST = 0.05  # of that sun's channels, which the model's is taken to have at least: in haze a low one has none


def change(lighting: Lighting, changes: Mapping[str, float | Colour]) -> Lighting:
    """The light with other values of `sun_azimuth`, `sun_elevation`, `turbidity`, `exposure` or `ground_color`.

    Those of the camera, `camera_elevation`, `camera_roll` and `vertical_fov`, move no light.
    Where irradiances are stated, their ratios to the model's, channel by channel, stay as they were; a sun under 5 deg
    is to the model as one of 5 deg. A `sun_irradiance`, `sky_irradiance` or `sky_cover` among the changes counts as it
    is; the sky's power follows the cover. Raises ParameterError for a value out of range, and for what is no
    Lighting.
    """
    check_lighting(lighting)
    values: dict[str, Any] = dict(changes)
    changed = replace(lighting, **values)
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return changed
    followed = changed
    if "sun_irradiance" not in changes:
        sun = _followed(lighting.sun_irradiance, _sun(lighting), _sun(changed))
        followed = replace(followed, sun_irradiance=clipped_colour(sun, "sun_irradiance"))
    if "sky_irradiance" not in changes:
        sky = _followed(lighting.sky_irradiance, _sky(lighting), _sky(changed))
        followed = replace(followed, sky_irradiance=clipped_colour(sky, "sky_irradiance"))
    return followed


def _sun(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, or what stands for it where the model's would vanish."""
    there, high = (
        disc_power(replace(lighting, sun_elevation=elevation))[0]
        for elevation in (max(lighting.sun_elevation, _LOWEST), _HIGH)
    )
    return np.asarray(np.maximum(there, _WEAKEST * high))


def _sky(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, the share of its overcast part grey."""
    clear = clear_irradiance(lighting, lobe_table(lighting))
    cover = lighting.sky_cover or 0.0
    return np.asarray((1 - cover) * clear + cover * float(luminance(clear)))


def _followed(stated: Colour, before: Floats, after: Floats) -> Floats:
    """The stated irradiance (3,) times what the model's has changed by."""
    return np.asarray(np.array(stated) * after / np.maximum(before, _LEAST))
