"""Tests of scheduling."""

import json
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.types import Message

from lighting.estimator import Estimator
from lighting.photo.reader import Photo
from lighting.photo_estimate import Estimate
from server.app import create_app
from server.dependencies import Service
from server.limits import Client as Asker
from server.limits import client_of_address
from server.problems import SHARE_TAKEN, ProblemError
from server.scheduling import HALF_LIFE, CpuUsage, WorkLimiter
from server.settings import Settings
from tests.server.conftest import Client, refused, until


class Held:
    """A service with one place and one waiting place whose readings of photos last until `release`."""

    def __init__(self, estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
        self.app: FastAPI = create_app(Settings(concurrency=1, queue=1), estimator)
        self.service: Service = self.app.state.service
        self.release = threading.Event()
        self.estimates = 0
        read, estimate = self.service.read_photo, self.service.estimate

        def held_read(*arguments: Any) -> Photo:
            assert self.release.wait(30)
            photo: Photo = read(*arguments)
            return photo

        def counted_estimate(*arguments: Any) -> list[Estimate]:
            self.estimates += 1
            answer: list[Estimate] = estimate(*arguments)
            return answer

        monkeypatch.setattr(self.service, "read_photo", held_read)
        monkeypatch.setattr(self.service, "estimate", counted_estimate)


@pytest.fixture
def held(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> Held:
    return Held(estimator, monkeypatch)


def test_limiter_places_run_out_and_come_back() -> None:
    limiter = WorkLimiter(1, 1)
    with limiter.admission():
        with limiter.admission():
            assert (limiter.admitted, limiter.waiting) == (2, 2)
            with refused(SHARE_TAKEN), limiter.admission():
                raise AssertionError("there was no place")
        with limiter.admission():
            assert limiter.admitted == 2
    with pytest.raises(KeyError), limiter.admission():
        raise KeyError
    assert limiter.admitted == 0


def test_a_full_queue_is_told_at_once_and_who_leaves_it_makes_room(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        running, waiting, refused, late = (Client(held.app, jpeg) for _ in range(4))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(running.ask)
            await until(lambda: held.service.limiter.running == 1)
            tasks.start_soon(waiting.ask)
            await until(lambda: held.service.limiter.waiting == 1)
            await refused.ask()
            assert refused.status == 429
            assert refused.headers[b"retry-after"] == b"1"
            assert json.loads(refused.sent[1]["body"])["type"].endswith(":share-taken")
            waiting.gone.set()
            await until(lambda: held.service.limiter.admitted == 1)
            tasks.start_soon(late.ask)
            await until(lambda: held.service.limiter.waiting == 1)
            held.release.set()
        assert (running.status, waiting.status, late.status) == (200, 499, 200)
        assert held.service.limiter.admitted == held.service.limiter.running == 0

    anyio.run(scenario)


def test_work_for_a_client_that_has_gone_stops_at_its_next_step(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        client = Client(held.app, jpeg)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(client.ask)
            await until(lambda: held.service.limiter.running == 1)
            client.gone.set()
            await anyio.sleep(0.01)
            held.release.set()
        assert client.status == 499
        assert held.estimates == 0
        assert held.service.limiter.admitted == held.service.limiter.running == 0

    anyio.run(scenario)


def test_a_queue_that_filled_during_an_upload_is_told(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        late, *others = (Client(held.app, jpeg) for _ in range(3))
        late.bodies = [
            {"type": "http.request", "body": jpeg[100:], "more_body": False},
            {"type": "http.request", "body": jpeg[:100], "more_body": True},
        ]
        arrived = late.receive

        async def after_the_others() -> Message:
            if len(late.bodies) == 1:
                await until(lambda: held.service.limiter.admitted == 2)
            return await arrived()

        late.receive = after_the_others  # type: ignore[method-assign]
        async with anyio.create_task_group() as tasks:
            for client in (late, *others):
                tasks.start_soon(client.ask)
            await until(lambda: late.status)
            held.release.set()
        assert [client.status for client in (late, *others)] == [429, 200, 200]

    anyio.run(scenario)


def test_what_work_raises_comes_out_as_it_is() -> None:
    async def never() -> Message:
        await anyio.sleep_forever()
        raise AssertionError

    def fail() -> None:
        raise KeyError("work")

    async def scenario() -> None:
        limiter = WorkLimiter(1, 0)
        with limiter.admission() as job, pytest.raises(KeyError, match="work"):
            await limiter.run(job, never, fail)

    anyio.run(scenario)


GREEDY, MODEST, OTHER = (Asker((name,)) for name in ("greedy", "modest", "other"))


async def never() -> Message:
    """ASGI's channel of a client that stays."""
    await anyio.sleep_forever()
    raise AssertionError


class Runs:
    """Jobs of a limiter, which work until they are let go, and the order in which they began and ended."""

    def __init__(self, limiter: WorkLimiter) -> None:
        self.limiter = limiter
        self.began: list[str] = []
        self.ended: dict[str, str] = {}
        self.gates: dict[str, threading.Event] = {}

    async def ask(self, name: str, client: Asker, route: str = "", seconds: float = 0.0, size: int = 0) -> None:
        """Ask for work that takes some processor time once it is let go."""
        gate = self.gates[name] = threading.Event()

        def work() -> None:
            self.began.append(name)
            assert gate.wait(30)
            until_then = time.thread_time() + seconds
            while time.thread_time() < until_then:
                pass

        try:
            with self.limiter.admission(client, route, size) as job:
                await self.limiter.run(job, never, work)
            self.ended[name] = "done"
        except ProblemError as error:
            self.ended[name] = error.kind.name


def run_scenario(runs: Runs, scenario: Callable[[Any], Any]) -> None:
    """Run a scenario, which gets a function that starts a job and waits until it is admitted or refused."""

    async def main() -> None:
        async with anyio.create_task_group() as tasks:

            async def start(name: str, client: Asker, **more: Any) -> None:
                tasks.start_soon(partial(runs.ask, name, client, **more))
                await anyio.wait_all_tasks_blocked()

            await scenario(start)
            while runs.limiter.admitted:
                for gate in list(runs.gates.values()):
                    gate.set()
                await anyio.sleep(0.002)

    anyio.run(main)


def test_who_has_less_takes_the_place_of_the_greediest_one_s_newest() -> None:
    runs = Runs(WorkLimiter(1, 3))

    async def scenario(start: Any) -> None:
        for number in range(5):
            await start(f"greedy {number}", GREEDY)
        assert runs.ended == {"greedy 4": "share-taken"}
        assert not runs.limiter.full  # for anybody else
        await start("modest", MODEST)
        assert runs.ended["greedy 3"] == "share-taken"
        await start("greedy 5", GREEDY)
        assert runs.ended["greedy 5"] == "share-taken"
        await start("other", OTHER)
        assert runs.ended["greedy 2"] == "share-taken"
        await start("fourth", Asker(("fourth",)))
        assert runs.ended["greedy 1"] == "share-taken"
        assert runs.limiter.full
        await start("late", Asker(("late",)))  # everybody has one
        assert runs.ended["late"] == "busy"
        assert runs.limiter.admitted == 4

    run_scenario(runs, scenario)
    assert {name for name, end in runs.ended.items() if end == "done"} == {"greedy 0", "modest", "other", "fourth"}


def test_one_site_s_networks_are_as_greedy_as_one_client() -> None:
    runs = Runs(WorkLimiter(1, 7))

    async def scenario(start: Any) -> None:
        for number in range(8):
            await start(f"site {number}", client_of_address(f"2001:db8:0:{256 * number:x}::1"))
        await start("home", client_of_address("2001:db8:1::1"))
        assert runs.ended == {"site 7": "share-taken"}

    run_scenario(runs, scenario)
    assert runs.ended["home"] == "done"


def test_the_next_turn_is_of_the_client_that_used_least() -> None:
    runs = Runs(WorkLimiter(1, 9))

    async def scenario(start: Any) -> None:
        await start("greedy 0", GREEDY, seconds=0.05)
        for name, client in (("greedy 1", GREEDY), ("greedy 2", GREEDY), ("modest 0", MODEST), ("modest 1", MODEST)):
            await start(name, client, seconds=0.02)
        for name in ("greedy 0", "modest 0", "modest 1", "greedy 1", "greedy 2"):
            runs.gates[name].set()
            await until(partial(runs.ended.get, name))

    run_scenario(runs, scenario)
    assert runs.began == ["greedy 0", "modest 0", "modest 1", "greedy 1", "greedy 2"]
    assert 0.08 < runs.limiter.usage.load(GREEDY) < 0.15
    assert 0.03 < runs.limiter.usage.load(MODEST) < 0.08


async def show_long_route(runs: Runs, start: Any) -> None:
    """A request of the route "long", by whose time the limiter knows the route."""
    await start("first", GREEDY, route="long", seconds=0.25)
    runs.gates["first"].set()
    await until(lambda: "first" in runs.ended)


def test_long_requests_have_all_threads_and_a_short_one_begins_beside_them() -> None:
    runs = Runs(WorkLimiter(2, 9))

    async def scenario(start: Any) -> None:
        await show_long_route(runs, start)
        await start("short 0", MODEST, route="short")
        runs.gates["short 0"].set()
        await until(lambda: "short 0" in runs.ended)
        for number in range(3):
            await start(f"long {number}", GREEDY, route="long")
        await until(lambda: {"long 0", "long 1"} <= {*runs.began})
        for number in range(1, 3):
            await start(f"short {number}", MODEST, route="short")
        await until(lambda: "short 1" in runs.began)
        assert not {"long 2", "short 2"} & {*runs.began}
        assert runs.limiter.running == 3
        runs.gates["short 1"].set()
        await until(lambda: "short 2" in runs.began)
        assert "long 2" not in runs.began

    run_scenario(runs, scenario)
    assert runs.ended["long 2"] == "done"


def test_long_requests_get_their_clients_part_of_the_threads_while_short_ones_wait() -> None:
    now = [0.0]
    runs = Runs(WorkLimiter(1, 9, clock=lambda: now[0]))

    async def end(name: str, next_one: str) -> None:
        runs.gates[name].set()
        await until(lambda: runs.began[-1] == next_one)

    async def scenario(start: Any) -> None:
        await show_long_route(runs, start)
        await start("short", MODEST, route="short")
        runs.gates["short"].set()
        await until(lambda: "short" in runs.ended)
        now[0] = 100.0
        for number in range(2):
            await start(f"long {number}", Asker((f"long {number}",)), route="long")
        for number in range(3):
            await start(f"short {number}", Asker((f"short {number}",)), route="short")
        now[0] = 104.0
        await end("long 0", "short 0")  # four seconds for two of five clients: the next one begins after ten
        now[0] = 109.0
        await end("short 0", "short 1")
        now[0] = 110.1
        await end("short 1", "long 1")

    run_scenario(runs, scenario)
    assert runs.began[-1] == "short 2"


def test_short_requests_alone_have_no_more_threads_than_there_are() -> None:
    runs = Runs(WorkLimiter(2, 9, short=["short"]))

    async def scenario(start: Any) -> None:
        for number in range(3):
            await start(f"short {number}", MODEST, route="short")
        await until(lambda: {"short 0", "short 1"} <= {*runs.began})
        assert "short 2" not in runs.began

    run_scenario(runs, scenario)
    assert runs.began[-1] == "short 2"


def test_photos_are_never_long_on_a_slow_machine() -> None:
    runs = Runs(WorkLimiter(2, 9, short=["short"]))

    async def scenario(start: Any) -> None:
        for number in range(2):  # the first one teaches what the second one takes
            await start(f"slow {number}", GREEDY, route="short", seconds=0.3)
            runs.gates[f"slow {number}"].set()
            await until(partial(runs.ended.get, f"slow {number}"))
        for number in range(2):
            await start(f"photo {number}", GREEDY, route="short")
        await until(lambda: {"photo 0", "photo 1"} <= {*runs.began})

    run_scenario(runs, scenario)


def test_processor_time_counts_half_after_a_while() -> None:
    now = [0.0]
    usage = CpuUsage(lambda: now[0])
    home = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101)]
    usage.add(home[0], 4.0)
    usage.add(home[1], 4.0)
    assert (usage.load(home[0]), usage.load(client_of_address("2001:db8:0:1ff::1"))) == (4.0, 4.0)
    now[0] = HALF_LIFE
    assert usage.load(home[0]) == pytest.approx(2.0)
    usage.add(home[0], 1.0)
    assert usage.load(home[0]) == pytest.approx(3.0)
    now[0] = 1e6
    usage.add(MODEST, 1.0)
    assert usage.load(home[0]) == 0.0
    assert list(usage._seconds) == ["modest"]


def test_the_processor_time_of_a_photo_is_the_decoder_s_too(estimator: Estimator, photo_path: Any) -> None:
    """The decoder is another process; its time is charged as that of the thread that waits for it."""
    from lighting.runtime import thread_seconds

    service = create_app(Settings(), estimator).state.service
    data = photo_path.read_bytes()
    service.read_photo(data, target=64)  # starts a decoder
    began, own = thread_seconds(), time.thread_time()
    service.read_photo(data, target=64)
    assert thread_seconds() - began > time.thread_time() - own > 0
    assert thread_seconds() - began < 10


def test_short_requests_go_first_and_take_the_place_of_long_ones() -> None:
    """Many hostile clients with one long request each keep nobody out, whatever they used before."""
    runs = Runs(WorkLimiter(1, 2))

    async def scenario(start: Any) -> None:
        for name, route, seconds in (("l", "long", 0.25), ("s", "short", 0.0)):
            await start(name, OTHER, route=route, seconds=seconds)
            runs.gates[name].set()
            await until(partial(runs.ended.get, name))
        runs.limiter.usage.add(MODEST, 2.0)
        for number in range(3):
            await start(f"long {number}", Asker((f"hostile {number}",)), route="long")
        assert runs.limiter.admitted == 3
        await start("short", MODEST, route="short")
        assert [name for name, end in runs.ended.items() if end == "busy"] == ["long 2"]
        await start("too long", MODEST, route="long")
        assert runs.ended["too long"] != "done"
        runs.gates["long 0"].set()
        await until(lambda: "short" in runs.began)
        assert "long 1" not in runs.began

    run_scenario(runs, scenario)
    assert runs.ended["short"] == runs.ended["long 1"] == "done"


def test_a_client_s_only_request_waits_beyond_the_queue_while_its_body_fits() -> None:
    runs = Runs(WorkLimiter(1, 1, max_bytes=100))

    async def scenario(start: Any) -> None:
        await start("first", OTHER, size=100)  # runs
        for number in range(4):
            await start(f"alone {number}", Asker((f"alone {number}",)), size=24)
        assert runs.ended == {}
        assert runs.limiter.waiting == 4
        assert not runs.limiter.full
        await start("again", Asker(("alone 0",)), size=1)
        assert runs.ended == {"again": "share-taken"}
        await start("too large", MODEST, size=4)
        assert runs.ended["too large"] == "busy"
        await start("small", GREEDY, size=3)
        assert runs.limiter.waiting == 5

    run_scenario(runs, scenario)
    assert [name for name, end in runs.ended.items() if end != "done"] == ["again", "too large"]


def test_requests_wait_beyond_the_queue_while_all_are_done_soon() -> None:
    runs = Runs(WorkLimiter(1, 1, max_bytes=100))

    async def scenario(start: Any) -> None:
        for number in range(40):  # each is expected to take a second
            await start(f"alone {number}", Asker((f"alone {number}",)))
        assert len([end for end in runs.ended.values() if end == "busy"]) == 40 - 31
        assert runs.limiter.full

    run_scenario(runs, scenario)


def test_without_a_queue_nothing_waits_beyond_it() -> None:
    runs = Runs(WorkLimiter(1, 0, max_bytes=100))

    async def scenario(start: Any) -> None:
        await start("first", OTHER)
        await start("second", MODEST)
        assert runs.ended == {"second": "busy"}

    run_scenario(runs, scenario)
