"""The page of fields is what the docstrings say."""

from scripts.make_fields import PAGE, write_tables


def test_the_page_is_that_of_the_docstrings() -> None:
    """Where this fails, run `python -m scripts.make_fields`."""
    assert PAGE.read_text(encoding="utf-8") == write_tables()
