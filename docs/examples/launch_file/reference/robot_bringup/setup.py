"""Builds and installs the package."""

from glob import glob

from setuptools import find_packages, setup

package_name = 'robot_bringup'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*')),
        ('share/' + package_name + '/config', glob('config/*')),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Student',
    maintainer_email='student@example.com',
    description="Starts a robot's nodes.",
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'driver = robot_bringup.driver:main',
            'monitor = robot_bringup.monitor:main',
        ],
    },
)
