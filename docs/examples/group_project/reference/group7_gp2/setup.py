"""Builds and installs the package."""

from setuptools import find_packages, setup

package_name = 'group7_gp2'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', ['launch/project.launch.py']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Student',
    maintainer_email='student@example.com',
    description='Drives a robot along several legs.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'drive_server = group7_gp2.drive_server:main',
            'mission = group7_gp2.mission:main',
        ],
    },
)
