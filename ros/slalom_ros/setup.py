from glob import glob

from setuptools import setup

setup(
    name="slalom_ros",
    version="0.1.0",
    packages=["slalom_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/slalom_ros"]),
        ("share/slalom_ros", ["package.xml"]),
        ("share/slalom_ros/launch", glob("launch/*")),
    ],
    install_requires=["numpy"],
    description="Slalom's policies, planners, guard and simulator as nodes of ROS 2 and ROS 1",
    license="MIT",
    entry_points={"console_scripts": [f"{node} = slalom_ros.ros2_{node}:main" for node in ("driver", "guard", "robot")]},
)
