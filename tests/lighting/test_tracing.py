"""Tests of the steps of long work."""

from time import time_ns

import pytest

from lighting.tracing import Step, listen_to_steps, report_step, trace_step


def test_steps_are_reported_as_they_end_while_somebody_listens() -> None:
    steps: list[Step] = []
    began = time_ns()
    with listen_to_steps(steps.append), trace_step("map"):
        with trace_step("decode"):
            pass
        with pytest.raises(KeyError), trace_step("network"):
            raise KeyError("secret")
    with trace_step("encode"):
        pass
    assert [(step.name, step.error) for step in steps] == [("decode", ""), ("network", "KeyError"), ("map", "")]
    decode, network, whole = steps
    times = [began, whole.start, decode.start, decode.end, network.start, network.end, whole.end, time_ns()]
    assert times == sorted(times)


def test_a_step_of_another_process_is_told_on() -> None:
    steps: list[Step] = []
    step = Step("map", 1, 2)
    report_step(step)
    with listen_to_steps(steps.append):
        report_step(step)
    assert steps == [step]
