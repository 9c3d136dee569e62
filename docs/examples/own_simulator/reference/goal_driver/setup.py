"""Builds and installs the package."""

from setuptools import find_packages, setup

package_name = 'goal_driver'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Student',
    maintainer_email='student@example.com',
    description='Drives the robot to a goal.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'driver = goal_driver.driver:main',
        ],
    },
)
