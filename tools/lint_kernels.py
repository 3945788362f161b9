"""Holds the house rules of the kernels: `python tools/lint_kernels.py [FILES]`, by default all of kernels/.

Prints `file:line: rule: message` for each breach and exits with 1 when there is one. The rules keep launches divisible
over threads, results the same bit for bit, and every kernel readable in the same order: thread index, grids, struct of
constants, inputs, outputs. The source is only parsed, never imported, so the lint needs neither Warp nor a device.
"""

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
SCALARS = {"int", "float", "bool"}
LISTS = {"Rows"}  # structs that hold no numbers but lists
OUTPUTS = ("_out", "_inout")
FLOAT_ATOMICS = {"wp.atomic_add", "wp.atomic_sub", "wp.atomic_min", "wp.atomic_max"}
BANNED_CALLS = {
    "wp.static": "numbers travel in a struct, formulas by closure; only `if wp.static(name)` leaves out a whole term",
    "print": "kernels are silent",
    "wp.printf": "kernels are silent",
}


def lint_file(path: Path) -> list["Breach"]:
    """Breaches of all rules in one file, by line. Raises SyntaxError where the file is not Python."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    shown = str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)
    breaches = [
        Breach(shown, node.lineno, rule, message)
        for function in device_functions(tree)
        for rule, check in FUNCTION_RULES.items()
        for node, message in check(function)
    ]
    breaches += [Breach(shown, node.lineno, "banned-call", message) for node, message in check_banned_calls(tree)]
    return sorted(breaches, key=lambda breach: (breach.line, breach.rule))


def device_functions(node: ast.AST, enclosing: tuple[ast.FunctionDef, ...] = ()) -> Iterator["DeviceFunction"]:
    """Every function decorated with wp.kernel or wp.func, whether at module level or inside a factory."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef):
            yield from device_functions(child, enclosing)
            continue
        for decorator in child.decorator_list:
            if dotted(decorator) in ("wp.kernel", "wp.func"):
                yield DeviceFunction(child, decorator, enclosing[0] if enclosing else None)
        yield from device_functions(child, (*enclosing, child))


# ---- the rules: each yields the node at fault and what is wrong with it ----


def check_thread_index(function: "DeviceFunction") -> Iterator["Fault"]:
    """A launch is split over CPU threads: each part starts at `first` and counts on from there."""
    tids = [call for call in calls(function.node) if dotted(call) == "wp.tid"]
    if not function.is_kernel:
        for tid in tids:
            yield tid, "only a kernel asks for wp.tid(); pass the index as an argument"
        return
    parameters = function.parameters
    if not parameters or parameters[0].arg != "first" or annotation_text(parameters[0]) != "int":
        yield function.node, f"the first parameter of {function.name} must be `first: int`"
    if len(tids) != 1 or function.index is None:
        yield function.node, f"{function.name} must have one `i = first + wp.tid()` and no other wp.tid()"


def check_decorator(function: "DeviceFunction") -> Iterator["Fault"]:
    """No kernel is differentiated; one closed over formulas has a module for itself, with options if need be."""
    options = 'module="unique", enable_backward=False' if function.factory else "enable_backward=False"
    wanted = f"wp.kernel({options})"
    found = re.sub(r", module_options=\w+\([\w, ]*\)(?=\)$)", "", ast.unparse(function.decorator))
    if function.is_kernel and found != ast.unparse(ast.parse(wanted, mode="eval")):
        yield function.node, f"{function.name} must be decorated @{wanted}"


def check_cached_factory(function: "DeviceFunction") -> Iterator["Fault"]:
    """The same formulas give the same kernel, not a new one to compile."""
    factory = function.factory
    if not function.is_kernel or factory is None:
        return
    if not any(ast.unparse(decorator) in ("functools.cache", "cache") for decorator in factory.decorator_list):
        yield factory, f"{factory.name} makes the kernel {function.name}: decorate it @functools.cache"


def check_argument_order(function: "DeviceFunction") -> Iterator["Fault"]:
    """Thread index, grids, struct of constants, inputs, outputs."""
    if not function.is_kernel:
        return
    previous = "first"
    for parameter in function.parameters:
        group = argument_group(parameter)
        if ARGUMENT_GROUPS.index(group) < ARGUMENT_GROUPS.index(previous):
            order = ", ".join(ARGUMENT_GROUPS)
            yield parameter, f"{parameter.arg} ({group}) comes after {previous}; the order is {order}"
        else:
            previous = group


def check_annotations(function: "DeviceFunction") -> Iterator["Fault"]:
    """A reader sees the type of every parameter, in one spelling."""
    for parameter in function.parameters:
        text = annotation_text(parameter)
        if not text:
            yield parameter, f"{parameter.arg} of {function.name} has no annotation"
        elif "array" in text and not is_array(parameter):
            yield parameter, f"{parameter.arg}: write wp.array[...] or wp.array2d[...], not {text}"


def check_docstring(function: "DeviceFunction") -> Iterator["Fault"]:
    """Every kernel, and every wp.func that is not private, says what it computes."""
    private = function.name.startswith("_") and not function.is_kernel
    if not private and not ast.get_docstring(function.node):
        yield function.node, f"{function.name} has no docstring"


def check_written_names(function: "DeviceFunction") -> Iterator["Fault"]:
    """The signature tells what is written."""
    names = {parameter.arg for parameter in function.parameters}
    written = [target for target, _ in assignments(function.node) if not isinstance(target, ast.Name)]
    written += [call.args[0] for call in calls(function.node) if dotted(call).startswith("wp.atomic_") and call.args]
    for target in written:
        name = root_name(target)
        if name in names and not name.endswith(OUTPUTS):
            yield target, f"{name} is written: name what is written *_out or *_inout"


def check_own_entries(function: "DeviceFunction") -> Iterator["Fault"]:
    """No thread reads what another thread writes in the same launch."""
    arrays = {parameter.arg for parameter in function.parameters if is_array(parameter)}
    only_written = {id(array_access(target)) for target, is_read_too in assignments(function.node) if not is_read_too}
    for access in ast.walk(function.node):
        if not isinstance(access, ast.Subscript) or not isinstance(access.value, ast.Name):
            continue
        name = access.value.id
        if name not in arrays:
            continue
        if name.endswith("_out") and id(access) not in only_written:
            yield access, f"{name} is read: sum in a local, or name it *_inout"
        if name.endswith("_inout") and leading_index(access) != (function.index or "i"):
            yield access, f"{name} is touched at [{ast.unparse(access.slice)}]: a thread keeps to its own index"


def check_atomics(function: "DeviceFunction") -> Iterator["Fault"]:
    """The order in which threads arrive must not show in the result."""
    for call in calls(function.node):
        if dotted(call) in FLOAT_ATOMICS:
            yield call, f"{dotted(call)} depends on the order of threads: let one thread do each sum"


def check_banned_calls(tree: ast.Module) -> Iterator["Fault"]:
    """Calls that have no place in kernels/, on the device or beside it."""
    switches = {
        id(choice.test)
        for choice in ast.walk(tree)
        if isinstance(choice, ast.If | ast.IfExp)
        and isinstance(choice.test, ast.Call)
        and all(isinstance(argument, ast.Name) for argument in choice.test.args)
    }
    for call in calls(tree):
        if dotted(call) in BANNED_CALLS and not (dotted(call) == "wp.static" and id(call) in switches):
            yield call, f"no {dotted(call)}: {BANNED_CALLS[dotted(call)]}"


FUNCTION_RULES = {
    "thread-index": check_thread_index,
    "decorator": check_decorator,
    "cached-factory": check_cached_factory,
    "argument-order": check_argument_order,
    "annotations": check_annotations,
    "docstring": check_docstring,
    "written-names": check_written_names,
    "own-entries": check_own_entries,
    "atomics": check_atomics,
}

# ---- reading the syntax tree ----

ARGUMENT_GROUPS = ("first", "grid", "struct", "input", "output")


def argument_group(parameter: ast.arg) -> str:
    """Which of ARGUMENT_GROUPS a parameter belongs to, by its name and annotation."""
    text = annotation_text(parameter)
    if parameter.arg == "first":
        return "first"
    if parameter.arg.endswith(OUTPUTS):
        return "output"
    if text == "wp.uint64":
        return "grid"
    if text and text not in SCALARS | LISTS and not text.startswith("wp."):
        return "struct"
    return "input"


def annotation_text(parameter: ast.arg) -> str:
    """The annotation as source, empty where there is none."""
    return ast.unparse(parameter.annotation) if parameter.annotation else ""


def is_array(parameter: ast.arg) -> bool:
    """Whether the annotation is an array in the one spelling that the house allows."""
    return annotation_text(parameter).startswith(("wp.array[", "wp.array2d["))


def dotted(node: ast.AST) -> str:
    """`wp.tid` for `wp.tid`, `wp.tid()` and `wp.tid(...)`."""
    return ast.unparse(node.func if isinstance(node, ast.Call) else node)


def calls(node: ast.AST) -> Iterator[ast.Call]:
    """Every call below a node."""
    return (child for child in ast.walk(node) if isinstance(child, ast.Call))


def assignments(node: ast.AST) -> Iterator[tuple[ast.expr, bool]]:
    """What is assigned to below a node, tuples taken apart, and whether the assignment reads it too (`+=`)."""
    for statement in ast.walk(node):
        if isinstance(statement, ast.Assign):
            for target in statement.targets:
                yield from ((part, False) for part in (target.elts if isinstance(target, ast.Tuple) else [target]))
        elif isinstance(statement, ast.AugAssign | ast.AnnAssign):
            yield statement.target, isinstance(statement, ast.AugAssign)


def root_name(node: ast.AST) -> str | None:
    """`a` for `a`, `a[i]`, `a.b[i]` and `a[i].x`."""
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def array_access(node: ast.AST) -> ast.Subscript | None:
    """The part `a[i]` of `a[i]`, `a[i][k]` and `a[i].x`: where the array itself is read or written."""
    while isinstance(node, ast.Subscript | ast.Attribute):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            return node
        node = node.value
    return None


def leading_index(access: ast.Subscript) -> str:
    """`i` for `a[i]` and for `a[i, k]`."""
    index = access.slice
    return ast.unparse(index.elts[0] if isinstance(index, ast.Tuple) and index.elts else index)


class Breach(NamedTuple):
    """One broken rule at one line."""

    file: str
    line: int
    rule: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.rule}: {self.message}"


Fault = tuple[ast.AST, str]


@dataclass(frozen=True)
class DeviceFunction:
    """A wp.kernel or wp.func, its decorator, and the outermost function around it (None at module level)."""

    node: ast.FunctionDef
    decorator: ast.expr
    factory: ast.FunctionDef | None

    @property
    def name(self) -> str:
        """As it is called."""
        return self.node.name

    @property
    def is_kernel(self) -> bool:
        """Whether it can be launched."""
        return dotted(self.decorator) == "wp.kernel"

    @property
    def parameters(self) -> list[ast.arg]:
        """All of them, in order."""
        arguments = self.node.args
        return [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]

    @property
    def index(self) -> str | None:
        """The name that is given `first + wp.tid()`, if any."""
        for statement in ast.walk(self.node):
            if isinstance(statement, ast.Assign) and ast.unparse(statement.value) == "first + wp.tid()":
                return root_name(statement.targets[0])
        return None


def main(arguments: list[str]) -> int:
    """Lints the files named, or all of kernels/; 1 when a rule is broken."""
    files = [Path(name) for name in arguments] or sorted((ROOT / "kernels").glob("*.py"))
    breaches = [breach for path in files for breach in lint_file(path)]
    for breach in breaches:
        print(breach)
    return 1 if breaches else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
