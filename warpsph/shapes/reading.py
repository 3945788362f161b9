"""trimesh, which reads meshes, loaded so that no signal is lost on the way.

While it loads it takes whatever is raised for an optional part that is missing: Ctrl-C at that moment, some seconds
long on a busy machine, was swallowed, and the command went on.
"""

import os
import signal
import threading

_come: list[int] = []
_numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_before = {}
if threading.current_thread() is threading.main_thread():  # Python hands signals to no other
    for _number in _numbers:
        if callable(signal.getsignal(_number)):
            _before[_number] = signal.signal(_number, lambda number, _: _come.append(number))
try:
    import trimesh
finally:
    for _number, _handler in _before.items():
        signal.signal(_number, _handler)
    for _number in _come[:1]:
        os.kill(os.getpid(), _number)  # what has come meanwhile comes now

__all__ = ["trimesh"]
