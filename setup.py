# SPDX-License-Identifier: Apache-2.0
"""Build of the package: by colcon (ament_python), and by pip into a virtual environment."""

import re
import sys
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "riem_planner"
ROOT = Path(__file__).resolve().parent


def version() -> str:
    """Return the one version string, from the package itself."""
    text = (ROOT / PACKAGE / "version.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"$', text, re.MULTILINE)
    if found is None:
        raise RuntimeError(f"{PACKAGE}/version.py has no line __version__ = ...")
    return found.group(1)


def data_files() -> list[tuple[str, list[str]]]:
    """Files outside the packages: the index entry, the manifest, the configuration."""
    share = f"share/{PACKAGE}"
    files = [
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (share, ["package.xml"]),
    ]
    folders = [Path("config"), *(p for p in Path("config").rglob("*") if p.is_dir())]
    for folder in sorted(folders):
        names = sorted(str(path) for path in folder.iterdir() if path.is_file())
        files.append((f"{share}/{folder}", names))
    if "bdist_wheel" in sys.argv:
        # pip puts the commands in bin; `ros2 run` looks here. colcon installs them here itself.
        files.append((f"lib/{PACKAGE}", sorted(str(p) for p in Path("resource/lib").iterdir())))
    return files


setup(
    name=PACKAGE,
    version=version(),
    description="Certified attitude trajectories that keep away from obstacles on SO(3) and S^2",
    license="Apache-2.0",
    maintainer="riem_planner maintainers",
    maintainer_email="maintainers@riem-planner.invalid",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*", "msg_adapters", "msg_adapters.*"]),
    package_data={PACKAGE: ["py.typed", "page/*.html", "page/*.css", "page/*.js"]},
    data_files=data_files(),
    python_requires=">=3.10",
    install_requires=[
        "matplotlib>=3.6",
        "numba>=0.57",
        "numpy>=1.24",
        "pyyaml>=6.0",
        "scipy>=1.11",
        "tqdm>=4.64",
    ],
    extras_require={
        # Where no ROS is sourced. `ros-X` without `jazzy` would be another distribution.
        "ros": [
            "ros-jazzy-rclpy==7.1.6",
            "ros-jazzy-common-interfaces==5.3.6",
            "ros-jazzy-rmw-fastrtps-cpp==8.4.3",
        ],
        # Balls of numbers, for riem_check.
        "proof": ["python-flint>=0.7"],
        # Directions of the Sun, the Moon, planets, sites and satellites. See docs/sky.md.
        "sky": ["skyfield>=1.49", "skyfield-data>=7.0"],
        # Tables and campaigns; and kernels for SPICE. See docs/surveys.md.
        "surveys": ["dask[distributed]>=2026.1", "pyarrow>=18"],
        "ck": ["spiceypy>=6.0"],
        "test": ["hypothesis>=6.98", "pytest>=7.4", "python-flint>=0.7"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "planner_node = riem_planner.node.main:main",
            "spacecraft_sim = riem_planner.spacecraft_sim.main:main",
            "riem_plan = riem_planner.riem_plan.command:main",
            "riem_timeline = riem_planner.riem_timeline.command:main",
            "riem_campaign = riem_planner.riem_campaign.command:main",
            "riem_export = riem_planner.riem_export.command:main",
            "riem_figures = riem_planner.paper.figures:main",
            "riem_check = riem_planner.proof.check:main",
            "riem_monitor = riem_planner.monitor_node.main:main",
            "sky_node = riem_planner.sky_node.main:main",
        ],
    },
)
