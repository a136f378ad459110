"""What the baseline refuses, and its statuses."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.problems import STARTS
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Request, Status
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import EXTENDED


@pytest.mark.parametrize("change", [{"precision": EXTENDED}, {"error_estimate": True}, {"domain": "edge"}])
def test_refusals(change) -> None:
    wanted = {"parameters": PRINTED, "omega": 30.4, "state": STARTS[1], "duration": 1.0} | change
    with pytest.raises(InputError):
        Baseline()(Request(**wanted))
    with pytest.raises(InputError):
        Baseline("Euler")


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_flat_and_step_limit(friction) -> None:
    assert Baseline()(Request(PRINTED.with_friction(friction), "29.9", STARTS[0], 10)).status is Status.FLAT
    assert Baseline()(Request(PRINTED, 30.4, STARTS[1], 10.0, max_steps=2)).status is Status.STEP_LIMIT
    assert Baseline()(Request(PRINTED.with_friction(friction), 30.4, (3.5, 0, 0), 10.0)).status is Status.FLAT


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "BDF"])
def test_what_leaves_the_doubles_has_a_status_and_no_warning(method) -> None:
    assert Baseline(method)(Request(PRINTED, 30.4, ("1.5", "0.2", "1e300"), 1e-3)).status is Status.NON_FINITE


def test_parameter_derivatives_of_the_smooth_law() -> None:
    request = Request(PRINTED.with_friction("smooth"), 30.4, STARTS[1], 1.0, variations=("Omega",))
    ends = [Baseline()(replace(request, omega=30.4 + step, variations=())).state for step in (1e-5, -1e-5)]
    # SciPy's error of 1e-11 over the step of the difference.
    assert abs(Baseline()(request).derivatives[:, 0] - (ends[0] - ends[1]) / 2e-5).max() < 1e-5
    with pytest.raises(InputError, match="no derivative with respect to 'k'"):
        Baseline()(Request(PRINTED.with_friction("smooth"), 30.4, STARTS[1], 1.0, variations=("k",)))
