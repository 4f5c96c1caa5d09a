"""The front matter of a Space, which Hugging Face reads."""

import re

from server.settings import Settings
from tests.helpers.pages import ROOT, text

COLORS = {"red", "yellow", "green", "blue", "indigo", "purple", "pink", "gray"}  # that the Hub takes


def test_the_front_matter_fits_the_image_and_the_hub() -> None:
    page, image = text(ROOT / "examples" / "huggingface" / "README.md"), text(ROOT / "Dockerfile")
    _, matter, prose = page.split("---\n", 2)
    values = dict(re.findall(r"^(\w+): (.+)$", matter, re.MULTILINE))
    assert values["sdk"] == "docker"
    assert f"EXPOSE {values['app_port']}\n" in image
    assert {values["colorFrom"], values["colorTo"]} <= COLORS
    assert len(values["short_description"]) <= 60
    named = set(re.findall(r"`LIGHTING_(\w+)`", prose))
    assert named == {"HOSTS", "FRAME_ORIGINS"}
    assert {name.lower() for name in named} <= set(Settings.model_fields)
