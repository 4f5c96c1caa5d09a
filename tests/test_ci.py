"""The one check and what calls it: the workflows and the hooks run what `.ci/run` runs."""

import re
import subprocess
from pathlib import Path

from tests.helpers.pages import ROOT, text
from tests.helpers.requirements import require

CHECK = text(ROOT / ".ci" / "run")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def jobs(workflow: Path) -> dict[str, str]:
    """The jobs of a workflow as text, by name."""
    parts = re.split(r"^  (\w+):$", text(workflow).partition("\njobs:\n")[2], flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_hooks_are_the_linters_of_the_check() -> None:
    entries = re.findall(
        r"entry: ([\w -]+?)(?: --force-exclude)?$", text(ROOT / ".pre-commit-config.yaml"), re.MULTILINE
    )
    linters = re.findall(r"^(ruff \w+|mypy|lint-imports)\b", CHECK, re.MULTILINE)
    assert sorted(entries) == sorted(linters)


def test_nothing_is_published_before_the_whole_check() -> None:
    check, release = (jobs(ROOT / ".github" / "workflows" / f"{name}.yml") for name in ("check", "release"))
    assert "run: .ci/run" in check["check"]
    assert "uses: ./.github/workflows/check.yml" in release.pop("check")
    assert all(re.search(r"^    needs: (check|wheel)$", job, re.MULTILINE) for job in release.values())


def test_the_code_of_a_pull_request_runs_without_privileges() -> None:
    container = jobs(ROOT / ".github" / "workflows" / "check.yml")["check"]
    options = re.findall(r"^      options: (.*)$", container, re.MULTILINE)
    assert options == [
        "${{ github.event_name == 'pull_request' && '--security-opt=no-new-privileges' || '--privileged' }}"
    ]
    assert "--privileged" not in container.replace(options[0], "")
    for workflow in WORKFLOWS:  # these would run a stranger's code with the repository's rights
        assert "pull_request_target" not in text(workflow)


def test_the_check_leaves_the_checkout_alone() -> None:
    assert not re.search(r"\brm\b(?! -rf \"\$work\")", CHECK)
    assert CHECK.index('cd "$work/copy"') < CHECK.index("run_readme try")


def test_actionlint_finds_nothing() -> None:
    done = subprocess.run([require("actionlint"), *map(str, WORKFLOWS)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "")
