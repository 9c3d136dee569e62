"""Builds and installs the package."""

from setuptools import setup

setup(
    name="cv_bridge",
    version="4.1.0",
    packages=["cv_bridge"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/cv_bridge"]),
        ("share/cv_bridge", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The rosgrade authors",
    maintainer_email="maintainers@example.org",
    description="Turns images of ROS into arrays of numpy and back.",
    license="Apache-2.0",
)
