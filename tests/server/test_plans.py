"""GET /v1/stereo/plan: the same plan as the library's, cached like maps, and problems for what cannot be planned."""

from typing import Any

import pytest
from starlette.testclient import TestClient

from server.plans import MOST_DAYS, StereoPlan

JUNE: dict[str, Any] = {"lat": 47, "lon": 10, "date": "2026-06-21", "sky": "overcast"}


def test_a_plan_is_whole_and_may_be_kept(client: TestClient) -> None:
    answer = client.get("/v1/stereo/plan", params=JUNE)
    assert answer.status_code == 200
    plan = StereoPlan.model_validate(answer.json())
    assert (plan.date, plan.utc_offset, [window.hours for window in plan.windows]) == ("2026-06-21", 1, [1, 2, 3, 6])
    assert answer.headers["cache-control"].startswith("public, max-age=")
    again = client.get("/v1/stereo/plan", params=JUNE, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"date": "2026-6-21"}, "date"),
        ({"date": "1750000000"}, "date"),
        ({"lat": 91}, "lat"),
        ({"shots": 2}, "shots"),
        ({"noise": 0}, "noise"),
        ({"sky": "foggy"}, "sky"),
        ({"facing": "south"}, "facing"),
        ({"colour": "red"}, "colour"),
        ({"until": "2026-06-20"}, "until"),
        ({"until": "2026-08-21"}, "until"),
        ({"shots": 1000}, "shots"),
        ({"until": "2026-07-10", "shots": 20}, "shots"),
        ({"date": "2200-06-21"}, "date"),
        ({"until": "2200-06-21"}, "until"),
    ],
)
def test_what_cannot_be_planned_is_a_problem(client: TestClient, changed: dict[str, Any], field: str) -> None:
    answer = client.get("/v1/stereo/plan", params={**JUNE, **changed})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert [error["field"] for error in answer.json()["errors"]] == [field]


@pytest.mark.parametrize("text", ["", "2026-6-21", "20260621", "1782000", "2026-06-21T00:00", "2026-06-21T12:00"])
def test_what_is_no_date_is_told_in_plain_words(client: TestClient, text: str) -> None:
    answer = client.get("/v1/stereo/plan", params={**JUNE, "date": text})
    assert answer.json()["detail"] == "date: must be a date such as 2026-06-21"


def test_night_is_a_problem(client: TestClient) -> None:
    answer = client.get("/v1/stereo/plan", params={**JUNE, "lat": 80, "date": "2026-12-21"})
    assert answer.status_code == 422
    assert "night all day" in answer.json()["detail"]
    assert [(error["field"], error["place"]) for error in answer.json()["errors"]] == [("date", "query")]


def test_a_range_is_short(client: TestClient) -> None:
    answer = client.get("/v1/stereo/plan", params={**JUNE, "until": "2026-07-22"})
    assert f"more than {MOST_DAYS} days" in answer.json()["detail"]
