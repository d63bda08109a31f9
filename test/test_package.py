# SPDX-License-Identifier: Apache-2.0
"""The package as a package: one version, a dependency for every import, a core without ROS."""

import ast
import configparser
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

import riem_planner

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()
ROS_FREE = ("rclpy", "ament_index_python", "builtin_interfaces", "rcl_interfaces", "std_srvs")

# Import name to the rosdep key that provides it, where they differ.
KEYS = {
    "matplotlib": "python3-matplotlib",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
}
OWN = {"riem_planner", "msg_adapters"}
EXTRAS = {
    "flint",
    "astropy",
    "dask",
    "distributed",
    "m4opt",
    "pyarrow",
    "skyfield",
    "skyfield_data",
    "spiceypy",
}
# of pip, for commands and adapters that say so


def sources(*folders):
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def imported(path):
    """Top-level names of everything that a file imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


def is_ros(name):
    return name in ROS_FREE or name.endswith("_msgs")


def test_one_version():
    assert MANIFEST.findtext("version") == riem_planner.__version__
    told = subprocess.run(
        [sys.executable, "setup.py", "--version"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.split()[-1] == riem_planner.__version__


def test_every_source_names_its_licence():
    own = sources("riem_planner", "msg_adapters", "test", "benchmark", "docs", "trust", "examples")
    silent = [p for p in own if b"SPDX-License-Identifier: Apache-2.0" not in p.read_bytes()[:200]]
    assert [path for path in silent if path.stat().st_size > 0] == []


def test_manifest_is_that_of_an_ament_python_package():
    assert MANIFEST.get("format") == "3"
    assert MANIFEST.findtext("name") == "riem_planner"
    assert MANIFEST.findtext("license") == "Apache-2.0"
    assert MANIFEST.findtext("export/build_type") == "ament_python"
    assert "Apache License" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert (ROOT / "resource/riem_planner").is_file()


def test_every_import_has_its_dependency_and_no_dependency_is_idle():
    names = set().union(*map(imported, sources("riem_planner", "msg_adapters")))
    third_party = names - set(sys.stdlib_module_names) - OWN - {"__future__"} - EXTRAS
    needed = {KEYS.get(name, name) for name in third_party}
    stated = {element.text for element in MANIFEST.findall("exec_depend")}
    assert stated == needed


def test_pip_requires_what_is_not_ros():
    text = (ROOT / "setup.py").read_text(encoding="utf-8")
    block = re.search(r"install_requires=\[(.*?)\]", text, re.DOTALL).group(1)
    required = {re.match(r"[a-z]+", item).group() for item in re.findall(r'"(.*?)"', block)}
    assert required == {"pyyaml" if name == "yaml" else name for name in KEYS}


def test_ros_is_pinned_alike_everywhere():
    pin = r"ros-jazzy-[a-z-]+==[0-9.]+"
    pinned = re.findall(pin, (ROOT / "requirements.txt").read_text(encoding="utf-8"))
    assert len(pinned) == 3
    assert re.findall(pin, (ROOT / "setup.py").read_text(encoding="utf-8")) == pinned


@pytest.mark.parametrize("path", sources("riem_planner"), ids=lambda p: str(p.relative_to(ROOT)))
def test_only_the_rooms_of_nodes_import_ros(path):
    if {"node", "spacecraft_sim", "demo", "monitor_node", "sky_node", "serving"} & {
        *path.relative_to(ROOT).parts
    }:
        return
    assert not [name for name in imported(path) if is_ros(name) or name == "msg_adapters"]


BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top in {ros} or top.endswith("_msgs") or top == "msg_adapters":
            raise ImportError("blocked: " + name)

sys.meta_path.insert(0, Blocked())
import riem_planner, riem_planner.riem_plan.command, riem_planner.plots.plots
import riem_planner.paper.figures
for name in riem_planner.__all__:
    getattr(riem_planner, name)
riem_planner.plan(riem_planner.Problem(
    riem_planner.State.from_quaternion_xyzw([0, 0, 0, 1]),
    riem_planner.State.from_quaternion_xyzw([0, 0, 0.6, 0.8]), 10.0))
assert not [name for name in sys.modules if name.endswith("_msgs") or name == "rclpy"]
"""


LIGHT = """
import sys, riem_planner as planner
start, goal = (planner.State.from_quaternion_xyzw([0, 0, s, c]) for s, c in ((0, 1), (0.6, 0.8)))
planner.plan(planner.Problem(start, goal, 10.0))
slow = {"scipy.integrate", "scipy.optimize", "scipy.spatial", "matplotlib"} & {*sys.modules}
assert not slow, slow
"""


@pytest.mark.parametrize("code", [BLOCKED.format(ros=repr(set(ROS_FREE))), LIGHT])
def test_core_plans_without_ros_and_without_what_is_slow_to_import(code):
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_core_prints_nothing():
    quiet = [
        path
        for path in sources("riem_planner")
        if not {
            "riem_plan",
            "riem_timeline",
            "riem_campaign",
            "riem_export",
            "paper",
            "demo",
            "node",
            "spacecraft_sim",
            "proof",
        }
        & {*path.relative_to(ROOT).parts}
    ]
    for path in quiet:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
        assert "print" not in {getattr(function, "id", None) for function in calls}, path


def test_commands_lead_to_functions_and_ros2_run_finds_each():
    text = (ROOT / "setup.py").read_text(encoding="utf-8")
    commands = dict(re.findall(r'"(\w+) = ([\w.]+):main"', text))
    assert commands.keys() == {
        "planner_node", "spacecraft_sim", "riem_plan", "riem_timeline", "riem_campaign",
        "riem_export", "riem_figures", "riem_check", "riem_monitor", "sky_node",
    }  # fmt: skip
    for name, module in commands.items():
        path = ROOT / (module.replace(".", "/") + ".py")
        functions = [
            node.name
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.FunctionDef)
        ]
        assert "main" in functions, path
        launcher = ROOT / "resource/lib" / name
        assert launcher.stat().st_mode & 0o111, launcher
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    assert setup["install"]["install_scripts"] == "$base/lib/riem_planner"
    assert setup["develop"]["script_dir"] == "$base/lib/riem_planner"


def test_warnings_are_errors():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    block = re.search(r"^filterwarnings = \[(.*?)^\]", text, re.DOTALL | re.MULTILINE).group(1)
    filters = re.findall(r'"(.*)"', block)
    assert filters[0] == "error"
    assert all("sre_" in line or "dateutil" in line for line in filters[1:])  # not ours


def test_make_names_every_promised_command():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert {"run", "test", "bench", "lint", "clean", "soak", "figures"} <= {*targets}


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))], ids=lambda page: page.name
)
def test_every_picture_and_page_that_is_linked_is_there(page):
    links = re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8"))
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing
    # A fresh clone has only what is not ignored.
    ignored = subprocess.run(
        ["git", "check-ignore", *(str(page.parent / link) for link in links)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert not ignored.stdout


COLD = """
import sys, riem_planner, riem_planner.escape, riem_planner.solver.roadmap
riem_planner.warm_up()
for module, found in {**sys.modules}.items():
    for name, kernel in vars(found).items() if module.startswith("riem_planner") else ():
        if getattr(kernel, "__module__", "") == module and hasattr(kernel, "overloads"):
            if "no_cpython_wrapper" not in kernel.targetoptions and not kernel.overloads:
                print(name)
"""


def test_warm_up_leaves_nothing_to_compile_later():
    done = subprocess.run(
        [sys.executable, "-c", COLD], cwd=ROOT, capture_output=True, text=True, check=True
    )
    # What only other compiled code calls.
    inner = "potential first_derivatives towards assemble kinetic_stencil factor substitute margin"
    assert {*done.stdout.split()} <= {*inner.split()}
