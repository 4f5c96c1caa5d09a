"""Tests of clock."""

from contextlib import suppress
from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.errors import ParameterError
from lighting.photo.timestamps import parse_time, parse_utc_offset, to_utc


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("2024-06-01T14:30", datetime(2024, 6, 1, 14, 30)),
        (" 2024-06-01 14:30:05 ", datetime(2024, 6, 1, 14, 30, 5)),
        ("2024-06-01T14:30Z", datetime(2024, 6, 1, 14, 30, tzinfo=UTC)),
        ("20240601T143005,5Z", datetime(2024, 6, 1, 14, 30, 5, 500_000, tzinfo=UTC)),
        ("2024-W22-6T14:30-0000", datetime(2024, 6, 1, 14, 30, tzinfo=UTC)),
        ("2024-06-01 14:30 +05:30", datetime(2024, 6, 1, 14, 30, tzinfo=timezone(timedelta(hours=5.5)))),
        ("2024-06-01T14:30+05:30", datetime(2024, 6, 1, 14, 30, tzinfo=timezone(timedelta(hours=5.5)))),
    ],
)
def test_times(text: str, time: datetime) -> None:
    found = parse_time(text)
    assert found == time
    assert found.utcoffset() == time.utcoffset()


@pytest.mark.parametrize(
    "text",
    ["", "now", "2024-02-30T10:00", "2024-06-01", "20240601", "2024-06-01T25:00", "9999-12-31T23:59-12:00", "14:30"],
)
def test_impossible_times_are_refused_in_one_sentence(text: str) -> None:
    with pytest.raises(ParameterError, match=r" is (not )?a .*\.$"):
        parse_time(text)


@pytest.mark.parametrize(
    "text", ["2024-06-01T12:00\0Z", "2024-06-01x12:00", "2024-06-01\x1b12:00", "2024-06-01T12:00_+02:00"]
)
def test_what_python_reads_as_a_time_and_people_do_not_write_is_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="is not a time such as"):
        parse_time(text)


@pytest.mark.parametrize("text", ["2024-06-01T12:00+23:00", "2024-06-01T12:00-12:30"])
def test_times_of_no_zone_are_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="offset from UTC"):
        parse_time(text)


@pytest.mark.parametrize(
    ("text", "hours"),
    [
        ("+02:00", 2),
        ("-03:30", -3.5),
        ("0545", 5.75),
        ("Z", 0),
        ("2", 2),
        ("-9.5", -9.5),
        ("+14", 14),
        ("-00:30", -0.5),
    ],
)
def test_offsets(text: str, hours: float) -> None:
    assert parse_utc_offset(text) == hours


@pytest.mark.parametrize("text", ["", "CET", "+2:75", "14:30", "-13", "1e1", "nan", "+02:00:00", "٣"])
def test_offsets_of_no_zone_are_refused(text: str) -> None:
    with pytest.raises(ParameterError, match=r"offset from UTC"):
        parse_utc_offset(text)


@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    for read in (parse_time, parse_utc_offset):
        with suppress(ParameterError):
            assert read(text) is not None


def test_local_time_in_utc() -> None:
    assert to_utc(datetime(2024, 1, 1, 1, 0), 2.0) == datetime(2023, 12, 31, 23, 0, tzinfo=UTC)
