"""Fixtures that every test can ask for."""

import pytest
import warp as wp

wp.config.log_level = wp.LOG_WARNING  # no line for each module loaded

DEVICES = ["cpu", "cuda:0"] if wp.get_cuda_device_count() > 0 else ["cpu"]


@pytest.fixture(scope="session", params=DEVICES)
def device(request) -> str:
    """Each device that a kernel must give the same answer on: the CPU, and the first GPU where there is one."""
    return request.param
