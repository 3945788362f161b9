"""Fixtures that every test can ask for."""

from collections.abc import Callable

import pytest
import warp as wp

from warpsph.scene import Scene, load_scene

wp.config.log_level = wp.LOG_WARNING  # no line for each module loaded

DEVICES = ["cpu", "cuda:0"] if wp.get_cuda_device_count() > 0 else ["cpu"]


@pytest.fixture(scope="session", params=DEVICES)
def device(request) -> str:
    """Each device that a kernel must give the same answer on: the CPU, and the first GPU where there is one."""
    return request.param


@pytest.fixture(scope="session")
def make_scene(tmp_path_factory) -> Callable[..., Scene]:
    """A function that loads a scene from its YAML, with overrides such as `run.courant=0.25`."""

    def make(text: str, *overrides: str) -> Scene:
        path = tmp_path_factory.mktemp("scene") / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path, overrides)

    return make
