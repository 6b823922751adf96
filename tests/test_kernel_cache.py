"""No compiled kernel outlives a change of what it calls, in whatever file that stands."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import wayproof
from wayproof.kernel_cache import delete_unused, kernel_digest

SOURCE = Path(wayproof.__file__).parent
CALLER = "from wayproof.maps import rates\nfrom wayproof.kernel_compiler import kernel\n"
CALLER += "from wayproof.maps.callee import doubled\n\n\n"
CALLER += "@kernel\ndef answer(x):\n    return doubled(x) + rates.RATE\n"
CALLEE = (
    "from wayproof.kernel_compiler import kernel\n\n\n@kernel\ndef doubled(x):\n    return 2 * x\n"
)


@pytest.fixture
def package(tmp_path):
    """A small `wayproof` whose kernel calls one of another file and holds a constant of a third."""
    root = tmp_path / "wayproof"
    for name in ("harness", "maps", "models", "planners"):
        (root / name).mkdir(parents=True)
        (root / name / "__init__.py").touch()
    for name in ("kernel_cache.py", "kernel_compiler.py"):
        shutil.copy(SOURCE / name, root / name)
    start = "from wayproof.kernel_cache import use_kernel_cache\n\nuse_kernel_cache()\n"
    (root / "__init__.py").write_text(start)
    (root / "maps" / "caller.py").write_text(CALLER)
    (root / "maps" / "callee.py").write_text(CALLEE)
    (root / "maps" / "rates.py").write_text("RATE = 1\n")
    return root


def environment_of(package, named=False):
    """Environment of a process that runs the package, with a folder of its own for its kernels."""
    here = {"PYTHONPATH": str(package.parent), "XDG_CACHE_HOME": str(package.parent / "caches")}
    return {k: v for k, v in os.environ.items() if named or k != "NUMBA_CACHE_DIR"} | here


def answer(package, *imports, then="pass", named=False):
    """What the kernel gives in a new process, which finds what the last one compiled."""
    code = "; ".join(
        (*imports, "from wayproof.maps.caller import answer", "print(answer(20))", then)
    )
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env=environment_of(package, named),
        capture_output=True,
        text=True,
        check=True,
    )
    return int(ended.stdout)


def test_a_change_of_a_callee_or_a_constant_in_another_file_is_seen(package):
    caches = package.parent / "caches" / "wayproof"
    assert answer(package) == 41
    assert answer(package, "import numba") == 41  # which has read its settings before
    assert len(list(caches.iterdir())) == 1
    (package / "maps" / "callee.py").write_text(CALLEE.replace("2 * x", "3 * x"))
    assert answer(package) == 61
    (package / "maps" / "rates.py").write_text("RATE = 5\n")
    assert answer(package) == 65
    assert len(list(caches.iterdir())) == 3
    assert all(any(cache.rglob("*.nbc")) for cache in caches.iterdir())


def test_what_is_cached_is_loaded_without_what_a_compiler_needs(package):
    compiler = "{'numba.np.arraymath', 'numba.np.npyimpl', 'scipy.linalg'} & set(sys.modules)"
    assert answer(package, "import sys", then=f"assert {compiler}") == 41
    assert answer(package, "import sys", then=f"assert not {compiler}") == 41


LARGEST = "from wayproof.kernel_compiler import allocating\n\n\n"
LARGEST += "@allocating\ndef answer(n):\n    a = np.arange(n)\n    return a.max()\n"
NEW = """
import numba, sys
from wayproof.maps.caller import answer
assert answer(42) == 41
lean = "numba.np.arraymath" not in sys.modules
try:
    answer(0)
except ValueError as error:
    assert "zero-size" in str(error)
else:
    raise AssertionError("a largest number of none")
twice = numba.njit(lambda n: 2 * answer(n))
assert twice(4) == 6
print(lean)
"""


def test_what_is_loaded_raises_and_is_called_by_kernels_compiled_later(package):
    (package / "maps" / "caller.py").write_text("import numpy as np\n" + LARGEST)
    (package.parent / "new.py").write_text(NEW)
    environment = environment_of(package)
    for lean in ("False\n", "True\n", "True\n"):
        command = [sys.executable, package.parent / "new.py"]
        assert subprocess.check_output(command, env=environment, text=True) == lean


UFUNC = "import numba\n\n\n@numba.vectorize(['float64(float64)'], cache=True)\n"
UFUNC += "def doubled(x):\n    return 2.0 * x\n"


def test_kernels_of_others_are_loaded_as_numba_does(package):
    """A cached ufunc of a stack could not be imported a second time."""
    (package.parent / "stack.py").write_text(UFUNC)
    for _ in range(2):
        assert answer(package, then="import stack; assert stack.doubled(1.0) == 2.0") == 41


def test_files_that_no_kernel_imports_do_not_matter(package):
    digest = kernel_digest.__wrapped__  # which remembers nothing
    before = digest(str(package))
    (package / "models" / "world.py").write_text("SIZE = 3\n")
    assert digest(str(package)) == before
    (package / "models" / "rays.py").write_text(CALLEE)
    assert digest(str(package)) != before


def test_caches_that_are_in_use_are_kept(tmp_path):
    for name, age_s in (("kernels-new", 0.0), ("kernels-old", 30 * 24 * 3600.0)):
        (tmp_path / name).mkdir()
        now = (tmp_path / name).stat().st_mtime
        os.utime(tmp_path / name, (now - age_s, now - age_s))
    delete_unused(str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["kernels-new"]


def test_a_second_checkout_finds_the_kernels_of_the_first(package, tmp_path, monkeypatch):
    """A copy compiled every kernel again, within an episode."""
    second = shutil.copytree(package, tmp_path / "second" / "wayproof")
    third = shutil.copytree(package, tmp_path / "third" / "wayproof")
    (third / "maps" / "callee.py").write_text(CALLEE.replace("2 * x", "3 * x"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named"))
    written = []
    for root, found in ((package, 41), (second, 41), (third, 61)):
        assert answer(root, named=True) == found
        kept = (tmp_path / "named").rglob("caller.answer*.nbc")
        written.append({path.stat().st_ino for path in kept})
    assert written[1] == written[0] < written[2]


SAID = "wayproof: compiling kernels (a minute the first time, then cached)\n"
TWO = """
from wayproof.kernel_cache import any_missed
from wayproof.maps.callee import doubled
from wayproof.maps.caller import answer
import numba
numba.njit(lambda x: x + 1)(20)
assert not any_missed()
answer(20)
doubled(20)
print(any_missed())
"""


def test_it_is_said_once_whenever_a_kernel_is_not_there(package):
    """A cache that had some kernels of an episode compiled the others without a word."""
    (package.parent / "two.py").write_text(TWO)
    environment = environment_of(package)
    caches = package.parent / "caches"

    def said():
        command = [sys.executable, package.parent / "two.py"]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert ended.stdout == f"{bool(ended.stderr)}\n"
        return ended.stderr

    assert [said(), said()] == [SAID, ""]
    for some in ("answer*.nbc", "doubled*.nbi"):
        for kept in caches.rglob(f"*.{some}"):
            kept.unlink()
        assert said() == SAID


def test_kernels_that_cannot_be_kept_there_are_kept_elsewhere(package, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "folder"))
    assert answer(package, named=True) == 41
    assert any((package / "maps" / "__pycache__").glob("caller.answer*.nbc"))
