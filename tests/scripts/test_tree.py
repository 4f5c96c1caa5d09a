"""Trees of files, as far as they need neither root nor mounts."""

from pathlib import Path

import pytest

from scripts.dockerfile import UnsupportedError, read_stages
from scripts.tree import Tree, _carry_out, _check_python, _copy_from_context


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path / "root", tmp_path / "layer")


@pytest.fixture
def context(tmp_path: Path) -> Path:
    folder = tmp_path / "context"
    (folder / "lighting" / "data").mkdir(parents=True)
    (folder / "lighting" / "data" / "a.bin").write_bytes(b"a")
    (folder / "LICENSE").write_text("free")
    (folder / ".dockerignore").write_text("*\n!lighting\n!LICENSE\n")
    return folder


def carry_out(text: str, tree: Tree, context: Path) -> None:
    (stage,) = read_stages(f"FROM base\n{text}\n")
    for step in stage.steps:
        _carry_out(step, tree, {}, context)


def test_steps_change_folder_user_and_environment(tree: Tree, context: Path) -> None:
    carry_out("ENV A=1 B=$A\nWORKDIR /srv\nWORKDIR app\nUSER 1000:1001", tree, context)
    assert tree.folder == "/srv/app"
    assert (tree.root / "srv" / "app").is_dir()
    assert tree.environment["A"] == "1"
    command = tree.command(["lighting"], C="2")
    assert command[:2] == ["chroot", str(tree.root)]
    assert {"--reuid=1000", "--regid=1001", "--no-new-privs", "C=2"} <= set(command)
    assert command[-1] == "lighting"


def test_root_keeps_its_capabilities(tree: Tree) -> None:
    assert "setpriv" not in tree.command(["true"])


def test_copy_keeps_a_folders_inside_and_a_files_name(tree: Tree, context: Path) -> None:
    carry_out("WORKDIR /app\nCOPY lighting lighting\nCOPY LICENSE ./", tree, context)
    assert (tree.root / "app" / "lighting" / "data" / "a.bin").read_bytes() == b"a"
    assert (tree.root / "app" / "LICENSE").read_text() == "free"


def test_what_the_context_lacks_is_named(tree: Tree, context: Path) -> None:
    with pytest.raises(FileNotFoundError, match="the context holds no notes"):
        _copy_from_context("notes", tree.root, context, into=False)


def test_an_image_of_another_python_is_refused() -> None:
    with pytest.raises(UnsupportedError, match=r"The image has Python 2\.7"):
        _check_python("python:2.7-slim")
