"""Old public names: each works, warns at the line that uses it, and is gone by its release."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import lighting
from lighting.deprecation import RENAMED
from lighting.estimator import Estimator
from lighting.model import Model
from lighting.photo.reader import photo_from_array

ATTRIBUTES = {  # of classes, and parameters
    "lighting.Estimator.together",
    "lighting.UserInput.use_exif",
    "lighting.photo.reader.Photo.facts",
    "lighting.video.stream.Tracker.given",
}


def release(text: str) -> tuple[int, ...]:
    """A version's numbers, in the order of releases."""
    return tuple(int(part) for part in text.split("."))


@pytest.mark.parametrize("old", RENAMED)
def test_the_release_without_an_old_name_has_not_come(old: str) -> None:
    """Where this fails, remove the old name."""
    assert release(lighting.__version__) < release(RENAMED[old].gone_in)


@pytest.mark.parametrize("old", sorted(RENAMED.keys() - ATTRIBUTES))
def test_an_old_name_is_the_new_one_and_warns(old: str) -> None:
    package, _, name = old.rpartition(".")
    new = RENAMED[old]
    with pytest.warns(
        DeprecationWarning, match=rf"^{old} is now {new.module}\.{new.name}; .* {new.gone_in}\.$"
    ) as seen:
        value = getattr(import_module(package), name)
    assert value is getattr(import_module(new.module), new.name)
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_what_was_never_public_is_an_attribute_error() -> None:
    for package in {old.rpartition(".")[0] for old in RENAMED.keys() - ATTRIBUTES}:
        with pytest.raises(AttributeError, match=f"^module '{package}' has no attribute 'nonsense'$"):
            _ = import_module(package).nonsense


def test_photos_taken_together_are_estimate_views(network: Path) -> None:
    estimator, photo = Estimator(Model.load(network)), photo_from_array(np.zeros((64, 64, 3), np.uint8))
    new = estimator.estimate_views([photo] * 2, headings=[0.0, 30.0], register=False)
    with pytest.warns(DeprecationWarning, match=r"Estimator\.together is now .*Estimator\.estimate_views") as seen:
        old = estimator.together([photo] * 2, headings=[0.0, 30.0], match=False)
    assert [estimate.lighting for estimate in old] == [estimate.lighting for estimate in new]
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_the_facts_of_a_photo_are_its_metadata() -> None:
    photo = photo_from_array(np.zeros((64, 64, 3), np.uint8))
    with pytest.warns(DeprecationWarning, match=r"Photo\.facts is now .*Photo\.metadata") as seen:
        assert photo.facts is photo.metadata
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_the_exif_switch_of_user_input_is_its_metadata() -> None:
    with pytest.warns(DeprecationWarning, match=r"UserInput\.use_exif is now .*UserInput\.metadata") as seen:
        old = lighting.UserInput(use_exif=False)
    assert old == lighting.UserInput(metadata=False)
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]
    with pytest.warns(DeprecationWarning, match=r"UserInput\.use_exif is now"):
        assert old.use_exif is False
