"""Tables in Markdown."""

import pytest

from export.evaluation.tables import figures_table, interval, number, table


def test_a_table_has_a_line_for_each_row() -> None:
    assert table(["", "a"], [["x", "1"], ["y", "2"]]).splitlines() == [
        "|  | a |",
        "| --- | --- |",
        "| x | 1 |",
        "| y | 2 |",
    ]


@pytest.mark.parametrize(
    ("value", "column", "shown"),
    [(12.34, "median", "12.3"), (12.34, "NLL", "12.34"), (8.0, "crops", "8"), (float("nan"), "median", "-")],
)
def test_a_column_decides_the_decimals(value: float, column: str, shown: str) -> None:
    assert number(value, column) == shown
    assert figures_table({"outdoor": {column: value}}).splitlines()[-1] == f"| outdoor | {shown} |"


def test_an_interval_shows_both_ends() -> None:
    assert interval((-1.26, 3.0)) == "-1.3 to 3.0"
    assert interval((-1.26, 3.0), 2) == "-1.26 to 3.00"
