"""The service on Ray Serve: the example as it stands, asked over HTTP while a replica is lost."""

import importlib
import json
import os
import socket
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import ray

serve = pytest.importorskip("ray.serve", reason="needs ray")

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # Ray and its children warn of much

ROOT = Path(__file__).parents[2]
PHOTO = ROOT / "examples" / "wide_street.jpg"
with socket.create_server(("127.0.0.1", 0)) as free:
    PORT = free.getsockname()[1]
URL = f"http://127.0.0.1:{PORT}"
PATIENCE = 120  # s, on a machine whose processors are busy


@pytest.fixture(scope="module")
def service() -> Iterator[str]:
    """The address of the example, with its replicas on two nodes."""
    from ray.cluster_utils import Cluster

    for check in ("READY", "HEALTH"):  # Ray gives up a proxy that starts slowly
        os.environ[f"RAY_SERVE_PROXY_{check}_CHECK_TIMEOUT_S"] = str(PATIENCE)
    sys.path.insert(0, str(ROOT / "examples"))
    head = {"num_cpus": 2, "object_store_memory": 200_000_000, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    cluster.add_node(num_cpus=1, object_store_memory=200_000_000)
    ray.init(address=cluster.address, log_to_driver=False, logging_level="error")
    serve.start(http_options={"port": PORT})
    serve.run(importlib.import_module("ray_serve").app)
    wait_until_routed()
    yield URL
    serve.shutdown()
    ray.shutdown()
    cluster.shutdown()
    sys.path.remove(str(ROOT / "examples"))


def wait_until_routed() -> None:
    """Returns once the proxy knows the way: it learns of an application shortly after the replicas run."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            with urllib.request.urlopen(f"{URL}/readyz", timeout=10):
                return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


def post_photo() -> Any:
    request = urllib.request.Request(
        f"{URL}/v1/lighting", PHOTO.read_bytes(), {"Content-Type": "image/jpeg"}, method="POST"
    )
    with urllib.request.urlopen(request, timeout=60) as response:
        return json.load(response)


def replicas() -> list[Any]:
    deployment = serve.status().applications["default"].deployments["Lighting"]
    return [ray.get_actor(name, "serve") for name in replica_names()] if deployment.replica_states else []


def replica_names() -> list[str]:
    actors = ray.util.list_named_actors(all_namespaces=True)
    return [actor["name"] for actor in actors if "#Lighting#" in actor["name"]]


def test_a_photo_is_answered_and_a_lost_replica_is_replaced(service: str) -> None:
    first = post_photo()
    assert -180 <= first["sun"]["azimuth"] <= 180
    assert len(replicas()) == 2
    lost = replica_names()[0]
    ray.kill(replicas()[0], no_restart=True)
    answers = [answer for answer in (patiently_post() for _ in range(6)) if answer["sun"] == first["sun"]]
    assert len(answers) == 6
    end = time.monotonic() + PATIENCE
    while (len(replica_names()) < 2 or lost in replica_names()) and time.monotonic() < end:
        time.sleep(0.2)
    assert len(replica_names()) == 2
    assert service == URL


def patiently_post() -> Any:
    """An answer, of a later attempt where the replica at work is the one that goes."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return post_photo()
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(1)
