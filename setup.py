"""Build and install cam_rig, with colcon (ament_python) as well as with pip."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "cam_rig"
NODES = [
    "law_server",
    "cam_drive",
    "follower",
    "microphone",
    "recorder",
    "player",
    "viewer",
    "panel",
]

# What `import cam_rig` and a simulation need. package.xml declares the same dependencies, and those
# of the extras below, by their rosdep keys; cam_rig/extras.py names the extra of a missing one.
CORE = ["numpy", "pydantic>=2", "pyyaml", "scipy"]
CLI = ["jinja2", "markupsafe", "rich", "typer>=0.12.4"]
PLOTS = ["matplotlib"]
BAGS = ["lz4", "mcap", "rosbags", "zstandard"]
# The viewer, and the page of it that is served to a browser.
VIEW = ["rerun-sdk", "starlette", "uvicorn", "websockets"]
PARQUET = ["pyarrow"]
CAD = ["ezdxf", "shapely>=2"]
# Compile the search for lift-offs and landings, with a C compiler; without them the same code runs
# in plain Python.
FAST = ["numba>=0.61", "setuptools>=77"]
# Solve the convex programs of `cam-rig design`: with cones, and linear ones that grow by rows.
DESIGN = ["clarabel>=0.11", "highspy>=1.11,<1.16"]
# A campaign's dataset, and the shares of its inputs.
CAMPAIGN = [*PARQUET, "salib>=1.5"]
# Serves `cam-rig panel` to a browser.
PANEL = ["starlette", "uvicorn", "websockets"]
# Sends a campaign's points to a cluster.
DASK = ["distributed"]
ALL = [*CLI, *PLOTS, *BAGS, *VIEW, *PARQUET, *CAD, *FAST, *DESIGN, *CAMPAIGN, *PANEL]
# Only for a plain Python; where ROS 2 is installed, these come from it.
ROS_WHEELS = [
    "ros-kilted-rclpy[fastrtps]",
    "ros-kilted-diagnostic-msgs",
    "ros-kilted-geometry-msgs",
    "ros-kilted-rcl-interfaces",
    "ros-kilted-rosgraph-msgs",
    "ros-kilted-sensor-msgs",
    "ros-kilted-std-msgs",
    "ros-kilted-std-srvs",
    "ros-kilted-trajectory-msgs",
    "ros-kilted-visualization-msgs",
]
# What `make bench` measures against, beside scipy's solvers.
BENCH = ["joblib", "pymoo", "scikit-sundae"]
# What `make docs` builds the documents with.
DOCS = ["mkdocs-material", "mkdocstrings[python]"]
TEST = [
    "cmeel-urdfdom",  # the parser of URDF that ROS has
    "duckdb",  # reads a campaign's dataset as its users do
    "hypothesis",
    "import-linter",
    "mcap-ros2-support",  # reads the golden bag as other viewers do
    "mpmath",
    "mypy",
    "pandas",
    "pillow",
    "playwright",
    "pytest",
    "pytest-timeout",
    "pytest-xdist",
    "ruamel.yaml",  # what the rig's own reader of YAML is compared with
    "ruff",
    "scipy-stubs",
    "setuptools>=77",  # builds the editable install from the lock, without build isolation
]


def share(folder: str) -> list[tuple[str, list[str]]]:
    """List every file under a folder as data_files, keeping its sub-folders."""
    files = (p for p in sorted(Path(folder).rglob("*")) if p.is_file())
    return [
        (f"share/{NAME}/{path.parent.as_posix()}", [str(path)])
        for path in files
        if "__pycache__" not in path.parts
    ]


def version() -> str:
    """Read the version in package.xml, where it stands once."""
    text = Path(__file__).with_name("package.xml").read_text(encoding="utf-8")
    return re.search(r"<version>(.+)</version>", text)[1]


setup(
    name=NAME,
    version=version(),
    description="A virtual cam test rig: cam laws, follower dynamics, noise, on ROS 2",
    license="Apache-2.0",
    author="cam_rig developers",
    author_email="cam_rig@example.org",
    maintainer="cam_rig developers",
    maintainer_email="cam_rig@example.org",
    python_requires=">=3.11,<3.15",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: [
            "py.typed",
            "panel/static/*/*",
            "show/*.css",
            "show/*.mplstyle",
            "report/templates/*",
            "report/templates/scene/*",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *share("config"),
        *share("launch"),
    ],
    zip_safe=False,
    install_requires=CORE,
    extras_require={
        "cli": CLI,
        "plots": PLOTS,
        "bags": BAGS,
        "view": VIEW,
        "parquet": PARQUET,
        "cad": CAD,
        "fast": FAST,
        "design": DESIGN,
        "campaign": CAMPAIGN,
        "panel": PANEL,
        "dask": DASK,
        "all": ALL,
        "ros-wheels": ROS_WHEELS,
        "bench": BENCH,
        "docs": DOCS,
        "test": TEST,
    },
    entry_points={
        "console_scripts": [
            f"cam-rig = {NAME}.cli:start",
            *(f"{node} = {NAME}.nodes.__main__:{node}" for node in NODES),
        ],
        # the name is the module's, so that naming it in pytest_plugins as well does no harm
        "pytest11": [f"{NAME}.testing = {NAME}.testing"],
    },
)
