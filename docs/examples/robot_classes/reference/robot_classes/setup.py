"""Builds and installs the package."""

from setuptools import find_packages, setup

package_name = 'robot_classes'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Student',
    maintainer_email='student@example.com',
    description='Moves two robots of one abstract class.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'robots = robot_classes.main:main',
        ],
    },
)
