"""The notes of a release; .ci/run builds a whole one and tries its wheel."""

import pytest

from lighting.version import __version__
from scripts.release import release_notes
from tests.helpers.pages import ROOT, text

CHANGES = "# Changes\n\nNewest first.\n\n## {}\n\n- One thing.\n\n## 0.1.0 (2026-01-01)\n\n- The first.\n"


def test_the_notes_are_the_newest_section() -> None:
    assert release_notes(CHANGES.format("0.2.0 (2026-02-02)"), "0.2.0", "v0.2.0") == "- One thing.\n"
    assert release_notes(CHANGES.format("Unreleased"), "0.2.0", None) == "- One thing.\n"


@pytest.mark.parametrize(
    ("heading", "tag", "words"),
    [
        ("0.2.0 (2026-02-02)", "v0.3.0", "The tag is v0.3.0, and the package's version is 0.2.0."),
        ("Unreleased", "v0.2.0", "is Unreleased; it must be 0.2.0 with its date"),
        ("0.2.0", "v0.2.0", "it must be 0.2.0 with its date"),
        ("0.1.9 (2026-02-02)", None, "it must be 0.2.0 with its date"),
    ],
)
def test_a_release_without_its_version_is_refused(heading: str, tag: str | None, words: str) -> None:
    with pytest.raises(SystemExit, match=words.replace(".", r"\.")):
        release_notes(CHANGES.format(heading), "0.2.0", tag)


def test_the_changelog_is_ready_for_this_version() -> None:
    notes = release_notes(text(ROOT / "CHANGELOG.md"), __version__, None)
    assert notes.startswith("- ")
    assert "## " not in notes
