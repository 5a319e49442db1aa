"""Stored reference values with many digits, and a fingerprint of their inputs.

`make references` computes and writes them. `make test-long` computes them again and compares.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from benchmark.speed.models import Case, Solution

#: Relative tolerances of the inputs and of the stored reference values. Inputs differ because the
#: functions of another machine round differently, and values by the effect of that rounding,
#: relative to the largest value.
SAME_INPUTS, SAME = 1e-8, 1e-13
REMEDY = "run `make references`"


class References:
    """Reference values of one test, numbered in the order of the calls.

    Parameters ----------
    mode : ``stored``, ``compute`` (and compare with the stored values) or ``write``
    path : JSON file of the test's module
    test : name of the test in the file
    """

    def __init__(self, mode: str, path: Path, test: str) -> None:
        self._mode, self._path, self._test, self._asked = mode, path, test, 0

    def __call__(
        self, compute: Callable[[], ArrayLike], inputs: Sequence[ArrayLike]
    ) -> NDArray[np.float64]:
        """Return the values of ``compute`` as floats: stored, compared or newly written.

        ``inputs`` are all numbers on which the values depend. Stored values of other inputs
        are an error.
        """
        name, self._asked = f"{self._test}:{self._asked}", self._asked + 1
        print_of_inputs = fingerprint(inputs)
        if self._mode == "write":
            values = np.asarray(compute(), dtype=np.float64)
            data = json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else {}
            data[name] = {"inputs": print_of_inputs.tolist(), "values": values.tolist()}
            self._path.parent.mkdir(exist_ok=True)
            lines = (f'"{key}": {json.dumps(data[key])}' for key in sorted(data))
            self._path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
            return values
        kept = json.loads(self._path.read_text(encoding="utf-8")).get(name)
        assert kept is not None, f"{self._path}: has no {name}; {REMEDY}"
        words = f"{self._path}: {name} is of other numbers; {REMEDY}"
        np.testing.assert_allclose(
            print_of_inputs, kept["inputs"], rtol=0, atol=SAME_INPUTS, err_msg=words
        )
        stored = np.array(kept["values"], dtype=np.float64)
        if self._mode == "compute":
            values = np.asarray(compute(), dtype=np.float64)
            scale = np.abs(values).max(axis=-1, keepdims=True)
            assert (np.abs(values - stored) <= SAME * scale).all(), words
        return stored

    def solution(self, case: Case, solve: Callable[[Case], Solution]) -> Solution:
        """Return displacement and velocity of a case by ``solve``, without events."""

        def compute() -> NDArray[np.float64]:
            found = solve(case)
            return np.vstack([found.displacement, found.velocity])

        numbers = [float(number) for number in vars(case.model).values()]
        inputs = (case.law.breaks, case.law.ordinates, case.speed, case.times, numbers)
        displacement, velocity = np.split(self(compute, inputs), 2)
        return Solution(displacement, velocity, ())


def fingerprint(inputs: Sequence[ArrayLike]) -> NDArray[np.float64]:
    """Return four numbers that change if any input changes by more than rounding."""
    flat = [np.ravel(np.asarray(one, dtype=np.float64)) for one in inputs]
    logarithms = np.arcsinh(1e6 * np.concatenate(flat))
    weights = np.cos(np.outer(np.arange(1, 5), np.arange(logarithms.size)))
    return weights @ logarithms


@pytest.fixture
def many_digits(request: pytest.FixtureRequest) -> References:
    """Reference values of the current test."""
    path = request.path.parent / "references" / f"{request.path.stem}.json"
    return References(request.config.getoption("references"), path, request.node.name)
