"""The house rules: which way imports run, what may be imported, exports, sizes, tooling paths."""

import ast
import importlib
import pkgutil
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("dtcasadi", "estimators", "ocp")
THIRD_PARTY = {"casadi", "numpy", "scipy", "matplotlib", "tqdm"}
FOLDERS = (*PACKAGES, "tests", "examples", "benchmarks")
MAX_LINES = 350
# The command line finds the packages above it when a command is called.
LAZY_DOOR = ROOT / "dtcasadi" / "cli"
# Of an extra each; the command line imports them when they are asked for.
EXTRAS = {"distributed"}


def sources(*folders: str) -> list[Path]:
    return [file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))]


def imports(file: Path) -> Iterator[tuple[str, bool]]:
    """Each absolutely imported top-level module, and whether that is inside a function."""

    def walk(node: ast.AST, lazy: bool) -> Iterator[tuple[str, bool]]:
        if isinstance(node, ast.Import):
            yield from ((name.name.split(".")[0], lazy) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0], lazy
        inside = lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, inside)

    return walk(ast.parse(file.read_text(encoding="utf-8"), str(file)), lazy=False)


def relative(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def test_the_import_walker_sees_what_it_should(tmp_path):
    file = tmp_path / "example.py"
    file.write_text(
        "import a.b, c\nfrom d.e import f\nfrom . import g\nfrom .h import i\n"
        "def j():\n    import k\nclass L:\n    import m\n"
    )
    expected = [("a", False), ("c", False), ("d", False), ("k", True), ("m", False)]
    assert list(imports(file)) == expected


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_run_one_way(package):
    allowed = {"dtcasadi": {"dtcasadi"}}.get(package, {"dtcasadi", package})
    wrong = [
        f"{relative(file)} imports {name}"
        for file in sources(package)
        for name, lazy in imports(file)
        if name in PACKAGES and name not in allowed and not (lazy and LAZY_DOOR in file.parents)
    ]
    assert not wrong


@pytest.mark.parametrize("package", PACKAGES)
def test_third_party_imports_are_the_declared_ones(package):
    known = THIRD_PARTY | set(PACKAGES) | set(sys.stdlib_module_names)
    wrong = [
        f"{relative(file)} imports {name}"
        for file in sources(package)
        for name, lazy in imports(file)
        if name not in known and not (name in EXTRAS and lazy and LAZY_DOOR in file.parents)
    ]
    assert not wrong


def test_casadi_is_never_star_imported():
    star = re.compile(r"^\s*from\s+\S+\s+import\s+\*", re.MULTILINE)
    wrong = [relative(f) for f in sources(*FOLDERS) if star.search(f.read_text(encoding="utf-8"))]
    assert not wrong


def modules() -> list[str]:
    names = list(PACKAGES)
    for package in PACKAGES:
        found = pkgutil.walk_packages([str(ROOT / package)], f"{package}.")
        names += [module.name for module in found if not module.name.endswith("__main__")]
    return names


def test_every_exported_name_resolves():
    for name in modules():
        module = importlib.import_module(name)
        exported = getattr(module, "__all__", [])
        missing = [export for export in exported if not hasattr(module, export)]
        assert not missing, f"{name}.__all__ names {missing}"
        assert len(set(exported)) == len(exported), f"{name}.__all__ repeats a name"


def test_the_front_door_lists_its_names():
    assert importlib.import_module("dtcasadi").__all__


def test_files_stay_small():
    lengths = {
        relative(file): len(file.read_text(encoding="utf-8").splitlines())
        for file in sources(*FOLDERS)
    }
    assert not {name: n for name, n in lengths.items() if n > MAX_LINES}


@pytest.fixture(scope="module")
def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_hard_dependencies_are_the_declared_five(project):
    names = {re.split(r"[<>=~!\[; ]", line)[0] for line in project["project"]["dependencies"]}
    assert names == THIRD_PARTY


def test_what_is_imported_on_demand_is_in_an_extra(project):
    extras = project["project"]["optional-dependencies"].values()
    assert {re.split(r"[<>=~!\[; ]", line)[0] for lines in extras for line in lines} >= EXTRAS


def test_console_scripts_exist(project):
    for target in project["project"]["scripts"].values():
        module, function = target.split(":")
        assert callable(getattr(importlib.import_module(module), function))


def test_paths_of_the_tools_exist(project):
    tool = project["tool"]
    targets = tool["hatch"]["build"]["targets"]
    paths = [
        *tool["mypy"]["files"],
        *tool["pytest"]["ini_options"]["testpaths"],
        *(pattern.removesuffix("/**") for pattern in tool["ruff"]["lint"]["per-file-ignores"]),
        *targets["wheel"]["packages"],
        project["project"]["readme"],
        *project["project"]["license-files"],
    ]
    assert not [path for path in paths if not (ROOT / path).exists()]
    assert set(targets["wheel"]["packages"]) == set(PACKAGES)
    assert set(tool["mypy"]["files"]) == {*PACKAGES, "tests"}


def test_versions_agree(project):
    version = project["project"]["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: {re.escape(version)}$", citation, re.MULTILINE)


def test_the_changelog_has_a_current_section(project):
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\]", text, re.MULTILINE)
    assert sections and sections[0] in ("Unreleased", project["project"]["version"])


def test_committed_results_name_no_place_of_a_machine():
    for file in sorted((ROOT / "benchmarks" / "results").glob("*.json")):
        assert not re.search(r'"/\w[^"]*"', file.read_text(encoding="utf-8")), file.name
