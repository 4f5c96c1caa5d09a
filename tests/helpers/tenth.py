"""A plugin for pytest that runs one test in ten, the same ones each time: `python -m pytest -p tests.helpers.tenth`."""

import zlib

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a tenth, by a checksum of the name."""
    left = [item for item in items if zlib.crc32(item.nodeid.encode()) % 10]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in set(left)]
