"""The kernel lint: a file that keeps the rules passes, and each rule catches its own breach and no other."""

from pathlib import Path
from textwrap import dedent

import lint_kernels
import pytest

GOOD = '''
from functools import cache

import warp as wp

from .parameters import Parameters


@wp.func
def drag(u: wp.vec3) -> wp.vec3:
    """Opposes the velocity."""
    return -u


@wp.kernel(enable_backward=False)
def kick(
    first: int,
    dt: wp.array[float],
    acceleration: wp.array[wp.vec3],
    velocity_inout: wp.array[wp.vec3],
):
    """u_i by one step."""
    i = first + wp.tid()
    velocity_inout[i] = velocity_inout[i] + dt[0] * acceleration[i]


@cache
def rate_kernel(law: wp.Function) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def rate(
        first: int,
        grid: wp.uint64,
        parameters: Parameters,
        velocity: wp.array[wp.vec3],
        scale: float,
        rate_out: wp.array[wp.vec3],
        table_out: wp.array2d[float],
    ):
        """a_i by drag."""
        i = first + wp.tid()
        total = wp.vec3()
        total += scale * law(velocity[i])
        rate_out[i] = total
        table_out[i, 0] = total[0]

    return rate
'''

# name: (rule that is broken, text of GOOD, what takes its place)
BREACHES = {
    "first is missing": ("thread-index", "    first: int,\n    dt:", "    dt:"),
    "first is not an int": ("thread-index", "    first: int,\n    dt:", "    first: wp.int64,\n    dt:"),
    "first is not added": ("thread-index", "i = first + wp.tid()\n    velocity", "i = wp.tid()\n    velocity"),
    "tid is asked for twice": ("thread-index", "total = wp.vec3()", "total = wp.vec3(float(wp.tid()))"),
    "a function asks for tid": ("thread-index", "return -u", "return -u * float(wp.tid())"),
    "module kernel is differentiated": ("decorator", "@wp.kernel(enable_backward=False)", "@wp.kernel"),
    "factory kernel shares a module": ("decorator", 'module="unique", ', ""),
    "module kernel is unique": (
        "decorator",
        "@wp.kernel(enable_backward=False)",
        '@wp.kernel(module="unique", enable_backward=False)',
    ),
    "factory is not cached": ("cached-factory", "@cache\n", ""),
    "grid after the struct": (
        "argument-order",
        "grid: wp.uint64,\n        parameters: Parameters,",
        "parameters: Parameters,\n        grid: wp.uint64,",
    ),
    "struct after an input": (
        "argument-order",
        "parameters: Parameters,\n        velocity: wp.array[wp.vec3],",
        "velocity: wp.array[wp.vec3],\n        parameters: Parameters,",
    ),
    "input after an output": (
        "argument-order",
        "scale: float,\n        rate_out: wp.array[wp.vec3],",
        "rate_out: wp.array[wp.vec3],\n        scale: float,",
    ),
    "an input is written": ("written-names", "rate_out[i] = total", "rate_out[i] = total\n        velocity[i] = total"),
    "a component of an input is written": (
        "written-names",
        "rate_out[i] = total",
        "rate_out[i] = total\n        velocity[i][0] = 0.0",
    ),
    "a struct is written": (
        "written-names",
        "total = wp.vec3()",
        "total = wp.vec3()\n        parameters.mass[i] = 1.0",
    ),
    "an input is written in a tuple": (
        "written-names",
        "total = wp.vec3()",
        "total, velocity[i] = wp.vec3(), wp.vec3()",
    ),
    "an input is written by an atomic": (
        "written-names",
        "total = wp.vec3()",
        "total = wp.vec3()\n        wp.atomic_exch(velocity, i, total)",
    ),
    "an output is read": ("own-entries", "rate_out[i] = total", "rate_out[i] = total + rate_out[i]"),
    "an output is added to": ("own-entries", "rate_out[i] = total", "rate_out[i] += total"),
    "another's entry is read": ("own-entries", "velocity_inout[i] +", "velocity_inout[i + 1] +"),
    "another's entry is written": ("own-entries", "velocity_inout[i] =", "velocity_inout[0] ="),
    "floating-point atomic": ("atomics", "rate_out[i] = total", "wp.atomic_add(rate_out, i, total)"),
    "no annotation": ("annotations", "scale: float,", "scale,"),
    "old array annotation": ("annotations", "rate_out: wp.array[wp.vec3]", "rate_out: wp.array(dtype=wp.vec3)"),
    "function without annotation": ("annotations", "u: wp.vec3", "u"),
    "kernel without docstring": ("docstring", '        """a_i by drag."""\n', ""),
    "function without docstring": ("docstring", '    """Opposes the velocity."""\n', ""),
    "static": ("banned-call", "scale * law", "wp.static(2.0) * law"),
    "static number in a condition": (
        "banned-call",
        "total = wp.vec3()",
        "total = wp.vec3()\n        if wp.static(2.0) > 1.0:\n            total = wp.vec3(1.0)",
    ),
    "print": ("banned-call", "total = wp.vec3()", "total = wp.vec3()\n        print(i)"),
    "printf": ("banned-call", "total = wp.vec3()", 'total = wp.vec3()\n        wp.printf("%d", i)'),
}

# name: (text of GOOD, what takes its place)
ALLOWED = {
    "functools.cache in full": ("@cache", "@functools.cache"),
    "another name for the index": (
        "i = first + wp.tid()\n    velocity_inout[i] = velocity_inout[i]",
        "k = first + wp.tid()\n    velocity_inout[k] = velocity_inout[k]",
    ),
    "an inout component": ("velocity_inout[i] = ", "velocity_inout[i][1] = 0.0\n    velocity_inout[i] = "),
    "an inout that is added to": ("velocity_inout[i] = velocity_inout[i] +", "velocity_inout[i] +="),
    "the size of an output": ("scale * law", "float(rate_out.shape[0]) * law"),
    "a private function without docstring": (
        'def drag(u: wp.vec3) -> wp.vec3:\n    """Opposes the velocity."""\n',
        "def _drag(u: wp.vec3) -> wp.vec3:\n",
    ),
    "a local vector that is written": ("total = wp.vec3()", "total = wp.vec3()\n        total[1] = 0.0"),
    "a term that is switched off": (
        "total = wp.vec3()",
        "total = wp.vec3()\n        if wp.static(drag):\n            total = wp.vec3(1.0)",
    ),
    "an integer array annotation": ("scale: float,", "scale: float,\n        count: wp.array[wp.int32],"),
}


def write(folder: Path, old: str = "", new: str = "") -> Path:
    """GOOD with one change, as a file."""
    assert GOOD.count(old) >= 1, f"not in GOOD: {old!r}"
    path = folder / "kernel.py"
    path.write_text(dedent(GOOD.replace(old, new, 1) if old else GOOD), encoding="utf-8")
    return path


def test_good_file_passes(tmp_path):
    assert lint_kernels.lint_file(write(tmp_path)) == []


@pytest.mark.parametrize(("rule", "old", "new"), BREACHES.values(), ids=BREACHES.keys())
def test_breach_is_found(tmp_path, rule, old, new):
    assert {breach.rule for breach in lint_kernels.lint_file(write(tmp_path, old, new))} == {rule}


@pytest.mark.parametrize(("old", "new"), ALLOWED.values(), ids=ALLOWED.keys())
def test_allowed_form_passes(tmp_path, old, new):
    assert lint_kernels.lint_file(write(tmp_path, old, new)) == []


def test_every_rule_has_a_breach_here():
    assert {rule for rule, _, _ in BREACHES.values()} == {*lint_kernels.FUNCTION_RULES, "banned-call"}


def test_output_names_file_line_and_rule(tmp_path, capsys):
    path = write(tmp_path, "rate_out[i] = total", "rate_out[i] += total")
    line = path.read_text(encoding="utf-8").splitlines().index("        rate_out[i] += total") + 1
    assert lint_kernels.main([str(path)]) == 1
    assert capsys.readouterr().out.startswith(f"{path}:{line}: own-entries: rate_out is read")


def test_kernels_keep_the_rules(capsys):
    assert lint_kernels.main([]) == 0, capsys.readouterr().out
