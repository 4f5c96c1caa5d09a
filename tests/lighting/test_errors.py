"""Errors as sentences."""

import pytest

from lighting import errors
from lighting.errors import LightingError, ParameterError, PhotoError, PhotoTooLargeError, reason


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (FileNotFoundError(2, "No such file or directory", "secret/photo.jpg"), "No such file or directory."),
        (OSError("the disk is gone"), "the disk is gone."),
        (PhotoError("The photo is empty."), "The photo is empty."),
    ],
)
def test_a_reason_is_one_sentence_without_the_file(error: Exception, sentence: str) -> None:
    assert reason(error) == sentence


def test_every_error_of_the_package_has_one_base() -> None:
    raised = [value for value in vars(errors).values() if isinstance(value, type) and issubclass(value, Exception)]
    assert len(raised) > 5
    assert all(issubclass(error, LightingError) for error in raised)
    assert issubclass(ParameterError, ValueError)
    assert issubclass(PhotoTooLargeError, PhotoError)
