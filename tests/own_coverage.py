"""Every pure module is covered by its own tests alone, branch by branch: `python -m tests.own_coverage [NAME ...]`.

Which modules are pure stands in `pyproject.toml`, in the contract of import-linter. Each is measured in a process of
its own, so that nothing counts which other tests happen to call. Names (`modbus/frame_search`) choose some of them. It
ends with 1 and names what is missing: a test file, a line, a branch, or a test that passes. A module that only declares
(data without methods, protocols) needs no test file.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
CONTRACT = "Pure modules know no clock, no loop, no socket"


def pure_modules() -> list[str]:
    """Return the pure modules as paths below the package without suffix, packages with all that is in them."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (names,) = [contract["source_modules"] for contract in contracts if contract["name"] == CONTRACT]
    modules: list[str] = []
    for name in names:
        path = name.removeprefix("lfs10d.").replace(".", "/")
        folder = ROOT / "lfs10d" / path
        inside = [f"{path}/{each.stem}" for each in sorted(folder.glob("*.py")) if each.stem != "__init__"]
        modules += inside or [path]
    return modules


def declares_only(source: str) -> bool:
    """Whether no function of a module does anything: a docstring, an ellipsis."""
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    done = [statement for each in functions for statement in each.body]
    return all(isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant) for each in done)


def test_files(module: str) -> list[Path]:
    """Return where the tests of a module stand: in `test_NAME.py`, and by subject in `test_NAME_SUBJECT.py`."""
    path = Path(module)
    folder = ROOT / "tests" / path.parent
    return [*folder.glob(f"test_{path.name}.py"), *sorted(folder.glob(f"test_{path.name}_*.py"))]


def missing(module: str) -> str:
    """Return what its own test files leave uncovered of a module, in words; nothing where that is nothing."""
    source = Path("lfs10d") / f"{module}.py"
    tests = test_files(module)
    if not tests:
        return "" if declares_only((ROOT / source).read_text()) else f"there is no tests/.../test_{source.name}"
    with tempfile.TemporaryDirectory() as folder:
        coverage = [sys.executable, "-m", "coverage"]
        data = f"--data-file={folder}/coverage"
        run = [*coverage, "run", data, "-m", "pytest", "-q", "-p", "no:cacheprovider", *map(str, tests)]
        # As in CI: examples are drawn the same way each time, without a deadline, and nothing is skipped.
        environment = {**os.environ, "CI": "1"}
        tested = subprocess.run(run, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        if tested.returncode != 0:
            return tested.stdout.strip().rsplit("\n", 1)[-1]
        report = [*coverage, "report", data, f"--include={source}", "--fail-under=100"]
        covered = subprocess.run(report, cwd=ROOT, capture_output=True, text=True, check=False)
    return "" if covered.returncode == 0 else covered.stdout.strip()


def main(names: list[str]) -> int:
    """Measure the modules named, or all; return how the process ends."""
    wanting = 0
    modules = names or pure_modules()
    for module in modules:
        if words := missing(module):
            wanting += 1
            print(f"{module}: {words}", flush=True)  # noqa: T201  # what it is for
    print(f"{len(modules) - wanting} of {len(modules)} pure modules are covered by their own tests")  # noqa: T201 - as above
    return 1 if wanting else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
