"""From logged input to decision no operation whose last bits depend on the processor.

What is looked for, in every module that a replay imports:

- matrix products and what calls BLAS, whose kernels follow the processor;
- elementary functions of the C library and of numpy, which choose variants by what it offers;
- powers, which are such a function unless both numbers stand there;
- sums of Python, which add floats otherwise from 3.12 on;
- sorts that order equal elements as they like, which numpy's do by the width of its vectors;
- compilers that are let reorder arithmetic.

`maps.elementary` has what is used in their place.
"""

import ast
import functools
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ENTRY = "harness.replay.replay"
PREFIX = "wayproof."
OURS = ("harness", "maps", "models", "planners")

ELEMENTARY = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan"),
    *("arctan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "arcsinh", "arccosh"),
    *("arctanh", "sinc", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "logaddexp"),
    *("pow", "power", "float_power", "cbrt", "hypot", "dist", "gamma", "lgamma", "erf", "erfc"),
    *("i0", "angle", "geomspace", "logspace", "sumprod"),
}
BLAS = {
    *("dot", "vdot", "inner", "matmul", "vecdot", "matvec", "vecmat", "tensordot", "einsum"),
    *("convolve", "correlate", "cov", "corrcoef", "linalg", "polyfit", "fft"),
}
METHODS = {
    *("dot", "normal", "standard_normal", "exponential", "standard_exponential", "gamma", "beta"),
    *("lognormal", "multivariate_normal", "rayleigh", "vonmises", "poisson", "binomial", "choice"),
}
SORTS = {"argsort", "argpartition", "partition", "sort_complex"}
FOREIGN = {"scipy", "cmath", "statistics", "torch", "jax"}

SUMS_OF_WHOLE_NUMBERS = (
    *("harness.replay.consistency.outcome", "harness.result"),
    *(
        "maps.kernels.edt_sections",
        "maps.kernels.update",
        "maps.others.block_map",
    ),
    *(
        "maps.voxel.update_mask",
        "maps.others.tracking",
        "maps.slot_pool",
        "maps.voxel.bricks",
        "maps.semantic",
    ),
    "planners.astar.lattice",
)
ALLOWED = {
    ("models.pose_model", "*"): "makes the estimate that is logged",
    ("models.sensors.devices.*", "*"): "makes the tables of beams that are logged",
    ("harness.perturbations.*", "*"): "makes the inputs that are logged",
    ("harness.interface.stacks.*", "*"): "gives the answers that are logged",
    ("maps.kernels.beam_columns", "**"): "a whole power of two",
    ("maps.kernels.edt_field", "**"): "the square of a whole number",
    ("maps.kernels.labels", "**"): "squares of whole numbers",
    ("harness.prediction.completion", "numpy.matmul"): "of whole numbers below 2^53",
    ("harness.prediction.completion", "**"): "of whole numbers, exact in floats",
    ("planners.frontier", "scipy"): "ndimage.label: whole numbers",
    **{(module, "sum"): "of whole numbers" for module in SUMS_OF_WHOLE_NUMBERS},
}
"""Module and what it uses -> why no decision depends on its last bits."""


def source_of(module):
    path = ROOT.joinpath(*module.split("."))
    for source in (path.with_suffix(".py"), path / "__init__.py"):
        if source.is_file():
            return source
    return None


def imported(nodes):
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name.removeprefix(PREFIX) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.removeprefix(PREFIX)
            yield from (f"{node.module}.{a.name}".removeprefix(PREFIX) for a in node.names)


def nodes_at_import(tree):
    """All nodes but those inside of functions, and those for type checkers."""
    for node in ast.iter_child_nodes(tree):
        yield node
        for_types = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        if not for_types and not isinstance(node, (ast.FunctionDef, ast.Lambda)):
            yield from nodes_at_import(node)


@functools.cache
def modules_of_a_replay():
    """What the entry imports of ours, by its text; of what decides, functions' imports as well."""
    found, left = {}, [ENTRY]
    while left:
        module = left.pop()
        source = source_of(module)
        if module in found or source is None or module.split(".")[0] not in OURS:
            continue
        found[module] = ast.parse(source.read_text())
        decides = module.startswith(("harness.stack", "maps", "planners"))
        nodes = (ast.walk if decides else nodes_at_import)(found[module])
        left += [module.rpartition(".")[0] or module, *imported(nodes)]
    return found


def names_of(tree):
    """What a module calls the modules and functions that it imports."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names[alias.asname or alias.name.split(".")[0]] = alias.name
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                names[alias.asname or alias.name] = f"{node.module}.{alias.name}"
    return names


def dotted(node, names):
    """The full name of `np.linalg.norm` and the like; empty for what is no such name."""
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        before = dotted(node.value, names)
        return f"{before}.{node.attr}" if before else ""
    return ""


def is_number(node):
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    return isinstance(node, ast.Constant) and isinstance(node.value, (int, float))


def of_operator(node):
    if not isinstance(node, (ast.BinOp, ast.AugAssign)):
        return None
    if isinstance(node.op, ast.MatMult):
        return "@"
    if isinstance(node.op, ast.Pow):
        literal = isinstance(node, ast.BinOp) and is_number(node.left) and is_number(node.right)
        return None if literal else "**"
    return None


def of_name(node, names):
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        roots = {name.split(".")[0] for name in imported([node])} & FOREIGN
        return min(roots) if roots else None
    if not isinstance(node, (ast.Name, ast.Attribute)):
        return None
    root, _, rest = dotted(node, names).partition(".")
    parts = set(rest.split("."))
    if root in ("numpy", "math", "numba") and parts & (ELEMENTARY | BLAS | {"prange"}):
        return f"{root}.{rest}"
    return None


def of_call(node, names):
    if not isinstance(node, ast.Call):
        return None
    name = dotted(node.func, names)
    if name in ("sum", "pow"):
        return name
    if any(word.arg in ("fastmath", "parallel") for word in node.keywords):
        return "fastmath"
    last = node.func.attr if isinstance(node.func, ast.Attribute) else name.rpartition(".")[2]
    stable = any(
        word.arg == "kind" and isinstance(word.value, ast.Constant) and word.value.value == "stable"
        for word in node.keywords
    )
    if last in SORTS and not stable and not (last == "partition" and is_text(node)):
        return last
    return last if isinstance(node.func, ast.Attribute) and last in METHODS else None


def is_text(node):
    """Whether a call of `partition` is that of a string: its argument is one."""
    return bool(node.args) and isinstance(getattr(node.args[0], "value", None), (str, bytes))


def findings(tree):
    names = names_of(tree)
    for node in ast.walk(tree):
        found = of_operator(node) or of_name(node, names) or of_call(node, names)
        if found:
            yield node.lineno, found


def reason_for(module, found):
    for (where, what), reason in ALLOWED.items():
        inside = where == module or (
            where.endswith(".*") and f"{module}.".startswith(where.removesuffix("*"))
        )
        if inside and what in ("*", found):
            return where, what, reason
    return None


def test_no_operation_of_a_replay_depends_on_the_processor():
    modules = modules_of_a_replay()
    expected = {
        "harness.stack.manoeuvres.stopping",
        "maps.voxel.voxel_map",
        "planners.kernels.segment",
        "models.sensors.beams",
    }
    assert expected <= modules.keys()
    bad = [
        f"{source_of(module).relative_to(ROOT)}:{line}: {found}"
        for module, tree in sorted(modules.items())
        for line, found in sorted(set(findings(tree)))
        if reason_for(module, found) is None
    ]
    assert not bad, "\n".join(["use maps.elementary, products and stable sorts instead of:", *bad])


def test_every_exception_is_one():
    used = {
        reason_for(module, found)
        for module, tree in modules_of_a_replay().items()
        for _, found in findings(tree)
    }
    kept = {(*key, reason) for key, reason in ALLOWED.items()}
    assert kept <= used, f"no longer needed: {kept - used}"


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("left /= np.sqrt(left @ left)", "@"),
        ("a @= b", "@"),
        ("np.linalg.norm(a)", "numpy.linalg.norm"),
        ("from numpy.linalg import norm; norm(a)", "numpy.linalg.norm"),
        ("a.dot(b)", "dot"),
        ("np.einsum('ij,ij->i', a, b)", "numpy.einsum"),
        ("np.cos(turned)", "numpy.cos"),
        ("list(map(math.atan2, a, b))", "math.atan2"),
        ("from math import exp as e; e(1.0)", "math.exp"),
        ("math.dist(a, b)", "math.dist"),
        ("x = a ** 2", "**"),
        ("a **= 0.5", "**"),
        ("pow(a, 0.5)", "pow"),
        ("sum(lengths)", "sum"),
        ("np.argsort(a)", "argsort"),
        ("a.argsort()", "argsort"),
        ("np.random.default_rng(1).normal()", "normal"),
        ("numba.njit(fastmath=True)", "fastmath"),
        ("import scipy.linalg", "scipy"),
    ],
)
def test_each_kind_is_found(line, found):
    tree = ast.parse(f"import math\nimport numba\nimport numpy as np\n{line}\n")
    assert found in {what for _, what in findings(tree)}


@pytest.mark.parametrize(
    "line",
    [
        "np.sqrt(x * x + y * y)",
        "2**31 - 1",
        "np.argsort(a, kind='stable')",
        "name.partition(':')",
        "a.sum(axis=1)",
        "math.floor(x)",
        "from wayproof.maps.elementary import cosine; cosine(x)",
    ],
)
def test_what_is_rounded_alike_everywhere_is_not(line):
    assert not list(findings(ast.parse(f"import math\nimport numpy as np\n{line}\n")))
