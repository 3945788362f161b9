"""Tests of the thread that writes frames while the steps go on."""

import threading
from types import SimpleNamespace

from warpsph.output import writers


def test_without_a_frame_writers_are_opened_before_anything_is_loaded_beside_them(monkeypatch, tmp_path):
    """A run that was interrupted in its warm-up hung now and then: two threads loaded libraries at once."""
    opened, finished = [], []
    writer = SimpleNamespace(finish=lambda: finished.append(threading.current_thread()))
    monkeypatch.setattr(writers, "WRITERS", {"usd": lambda *room: opened.append(threading.current_thread()) or writer})
    outputs = writers.Outputs(SimpleNamespace(output=SimpleNamespace(usd=True)), None, tmp_path, None)
    outputs.finish()
    outputs.wait()
    assert opened == [threading.main_thread()]
    assert finished and finished[0] is not threading.main_thread()
