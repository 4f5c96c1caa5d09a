"""Dependencies: bounds on both sides, one lock out of PyPI alone, and what is made from it."""

import re
import tomllib
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.connections import BoundedProtocol
from tests.helpers.pages import ROOT, text

PROJECT = tomllib.loads(text(ROOT / "pyproject.toml"))
LOCK: list[dict[str, Any]] = tomllib.loads(text(ROOT / "uv.lock"))["package"]
LOCKED = [(package["name"], package["version"]) for package in LOCK if "registry" in package["source"]]
REQUIREMENTS = sorted(
    {
        requirement
        for group in (PROJECT["project"]["dependencies"], *PROJECT["project"]["optional-dependencies"].values())
        for requirement in (*group, *PROJECT["build-system"]["requires"])
        if not requirement.startswith("outdoor-lighting[")
    }
)


@pytest.mark.parametrize("requirement", [Requirement(line) for line in REQUIREMENTS], ids=str)
def test_a_dependency_has_both_bounds_and_is_locked_between_them(requirement: Requirement) -> None:
    assert sorted(bound.operator for bound in requirement.specifier) == ["<", ">="]
    versions = [version for name, version in LOCKED if name == canonicalize_name(requirement.name)]
    assert all(requirement.specifier.contains(version) for version in versions)
    assert versions or requirement.name == "hatchling"


def test_the_lock_names_pypi_alone_and_hashes_all() -> None:
    others = [package for package in LOCK if "registry" not in package["source"]]
    assert [package["name"] for package in others] == [PROJECT["project"]["name"]]
    for package in LOCK:
        assert package["source"].get("registry", "https://pypi.org/simple") == "https://pypi.org/simple"
        for file in (*package.get("wheels", ()), *filter(None, [package.get("sdist")])):
            assert file["url"].startswith("https://files.pythonhosted.org/"), package["name"]
            assert re.fullmatch(r"sha256:[0-9a-f]{64}", file["hash"]), package["name"]


def test_the_constraints_are_the_lock() -> None:
    """The first lines say how they are made; `.ci/run` makes them and compares."""
    assert sorted(re.findall(r"^([\w.-]+)==(\S+)", text(ROOT / "constraints.txt"), re.MULTILINE)) == sorted(LOCKED)


def test_the_image_is_built_by_the_locked_uv() -> None:
    (uv,) = (package for package in LOCK if package["name"] == "uv")
    dockerfile = text(ROOT / "Dockerfile")
    assert re.findall(r"\buv==(\S+)", dockerfile) == [uv["version"]]
    hashes = set(re.findall(r"--hash=(\S+?)[\s\"]", dockerfile))
    assert len(hashes) == 2
    assert hashes <= {wheel["hash"] for wheel in uv["wheels"] if "manylinux" in wheel["url"]}


def test_members_of_uvicorn_that_the_service_overrides() -> None:
    """Uvicorn promises none of them: with a new one, look at each before the bound is raised."""
    (bound,) = (Requirement(r).specifier for r in PROJECT["project"]["dependencies"] if r.startswith("uvicorn"))
    assert Version(dict(LOCKED)["uvicorn"]).release[:2] == (0, 54)
    assert not bound.contains("0.55.0")
    overridden = {name for name in vars(BoundedProtocol) if hasattr(H11Protocol, name)}
    assert {name for name in overridden if not name.startswith("__")} == {
        "connection_lost",
        "connection_made",
        "data_received",
        "eof_received",
        "on_response_complete",
        "pause_writing",
        "resume_writing",
        "send_400_response",
        "shutdown",
        "_unsupported_upgrade_warning",
    }
