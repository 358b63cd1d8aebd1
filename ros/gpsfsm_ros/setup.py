"""How colcon installs the package. It holds no logic of its own: that is in gpsfsm, from pip."""

from glob import glob

from setuptools import setup

NAME = "gpsfsm_ros"

setup(
    name=NAME,
    version="0.2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", sorted(glob("launch/*.launch.py"))),  # noqa: PTH207
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    description="Runs, gates and dispatches robot plans on ROS 2 with gpsfsm",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"run_plan = {NAME}.scripts:run_plan",
            f"gate = {NAME}.scripts:gate",
            f"dispatch = {NAME}.scripts:dispatch",
        ]
    },
)
